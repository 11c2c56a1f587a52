"""Plot of the lap: the path through the room, and the speeds over time."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from cli.demo.score import Trace
from common.freshness import NS_PER_S
from common.motion import Command
from common.settings import Vehicle
from sim import trace as t
from sim.geometry import Pose, Rectangle
from sim.world import Plan
from t2.messages import Odometry

INK, TRUE, COUNTED, HIT = "#37474f", "#1565c0", "#ef6c00", "#c62828"


def save(
    files: Sequence[Path], plan: Plan, vehicle: Vehicle, trace: Trace, odometry: Sequence[Odometry]
) -> None:
    """Write the plot to each file, in the format of its suffix."""
    figure = Figure(figsize=(9, 9), layout="constrained")
    FigureCanvasAgg(figure)
    room, speeds = figure.subplots(2, 1, height_ratios=[3, 1])
    _draw_room(room, plan)
    _draw_path(room, Rectangle(vehicle.length / 2, vehicle.width / 2), trace, odometry)
    _draw_speeds(speeds, trace)
    for file in files:
        figure.savefig(file, dpi=110)


def _draw_room(axes: Axes, plan: Plan) -> None:
    for wall in plan.walls:
        xs, ys = zip(*wall.points, strict=True)
        axes.plot(xs, ys, color=INK, linewidth=3, solid_capstyle="projecting")
    for box in plan.boxes:
        style = {"hatch": "////", "fill": False} if box.low else {"facecolor": "#b0bec5"}
        corners = [box.pose.outward(x, y) for x, y in box.shape.corners()]
        axes.add_patch(Polygon(corners, edgecolor=INK, **style))
        name = f"{box.name}\n(too low for sonar)" if box.low else box.name
        y = box.y + box.width / 2 + 0.08 if box.low else box.y
        axes.annotate(
            name, (box.x, y), ha="center", va="bottom" if box.low else "center", fontsize=8
        )
    axes.set_aspect("equal")
    axes.set(xlabel="x, m", ylabel="y, m")
    axes.set_title(f"A lap of T2 through {plan.title}", pad=28)


def _draw_path(axes: Axes, body: Rectangle, trace: Trace, odometry: Sequence[Odometry]) -> None:
    truth = trace.truth
    axes.plot([x.x for x in truth], [x.y for x in truth], color=TRUE, linewidth=2, label="truth")
    axes.plot([p.x for p in odometry], [p.y for p in odometry], color=COUNTED, linewidth=1.2,
              linestyle="--", label="odometry")  # fmt: skip
    before = [x for x in truth if not x.contact and x.clearance is not None]
    closest = min(before, key=lambda x: x.clearance or 0.0, default=truth[0])
    _draw_body(axes, body, truth[0], INK, "start")
    _draw_body(axes, body, closest, TRUE, "stopped by sonar")
    hit = next((x for x in truth if x.contact), None)
    if hit is not None:
        _draw_body(axes, body, hit, HIT, "stopped by the bumper")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=5, fontsize=8)


def _draw_body(axes: Axes, body: Rectangle, at: t.Truth, color: str, label: str) -> None:
    """Draw the vehicle's outline, with a line to its front."""
    pose = Pose(at.x, at.y, at.heading)
    corners = [pose.outward(x, y) for x, y in body.corners()]
    axes.add_patch(Polygon(corners, fill=False, edgecolor=color, linewidth=1.2, label=label))
    nose = pose.outward(body.half_length, 0.0)
    axes.plot([pose.x, nose[0]], [pose.y, nose[1]], color=color, linewidth=1.2)


def _draw_speeds(axes: Axes, trace: Trace) -> None:
    start_ns = trace.truth[0].mono_ns
    runs = [(c.mono_ns, c.linear if c.kind is Command.RUN else 0.0) for c in trace.commands]
    axes.step([(at - start_ns) / NS_PER_S for at, _ in runs], [v for _, v in runs], where="post",
              color=COUNTED, linewidth=1.2, label="commanded, at the board")  # fmt: skip
    times_s = [(x.mono_ns - start_ns) / NS_PER_S for x in trace.truth]
    axes.plot(times_s, [x.linear for x in trace.truth], color=TRUE, linewidth=1.5, label="true")
    for hit in (b for b in trace.bumper if b.pressed):
        axes.axvline((hit.mono_ns - start_ns) / NS_PER_S, color=HIT, linewidth=1, linestyle=":")
    axes.set(xlabel="time, s", ylabel="speed, m/s")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=9)
