"""Plot of the lap: the path through the room."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from cli.demo.score import Trace
from common.settings import Vehicle
from sim.geometry import Pose, Rectangle
from sim.world import Plan
from t2.messages import Odometry

INK, TRUE, COUNTED, HIT = "#37474f", "#1565c0", "#ef6c00", "#c62828"


def save(
    file: Path, plan: Plan, vehicle: Vehicle, trace: Trace, odometry: Sequence[Odometry]
) -> None:
    """Write the plot."""
    figure = Figure(figsize=(9, 7), layout="constrained")
    FigureCanvasAgg(figure)
    room = figure.subplots()
    _draw_room(room, plan)
    _draw_path(room, Rectangle(vehicle.length / 2, vehicle.width / 2), trace, odometry)
    figure.savefig(file, dpi=110)


def _draw_room(axes: Axes, plan: Plan) -> None:
    for wall in plan.walls:
        xs, ys = zip(*wall.points, strict=True)
        axes.plot(xs, ys, color=INK, linewidth=3, solid_capstyle="projecting")
    for box in plan.boxes:
        corners = [box.pose.outward(x, y) for x, y in box.shape.corners()]
        axes.add_patch(Polygon(corners, edgecolor=INK, facecolor="none" if box.low else "#b0bec5"))
        name = f"{box.name} (too low for sonar)" if box.low else box.name
        axes.annotate(name, (box.x, box.y), ha="center", va="center", fontsize=8)
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
    places = [(truth[0], INK, "start"), (closest, TRUE, "stopped by sonar")]
    places += [(x, HIT, "stopped by the bumper") for x in truth if x.contact][:1]
    for at, color, label in places:
        pose = Pose(at.x, at.y, at.heading)
        # From the centre to the front, then around the outline.
        outline = [(0.0, 0.0), (body.half_length, 0.0), *body.corners(), (body.half_length, 0.0)]
        xs, ys = zip(*(pose.outward(x, y) for x, y in outline), strict=True)
        axes.plot(xs, ys, color=color, linewidth=1.2, label=label)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=5, fontsize=8)
