"""Plot of rounds: the route with its corridor, the true paths, what localization believed."""

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Ellipse, Polygon

from common.pose import Covariance
from common.settings import Vehicle
from sim.geometry import Pose, Rectangle
from sim.world import PERSON
from t2 import messages as m
from verification.patrol.draw import Point, Scene
from verification.patrol.picture import Recording, Sample

INK, TRUE, BELIEVED, REFUSED, FIX = "#37474f", "#1565c0", "#ef6c00", "#c62828", "#7b8d96"
CORRIDOR, BOX = "#dcedc8", "#b0bec5"
NAMED = 1.0  # m from a station to its name


def save(file: Path, scene: Scene, recording: Recording) -> None:
    """Write the plot."""
    figure = Figure(figsize=(9, 8.8), layout="constrained")
    FigureCanvasAgg(figure)
    yard, margin = figure.subplots(2, height_ratios=(3.4, 1))
    _draw_yard(yard, scene)
    rounds = f"{len(recording.paths)} rounds of a route"
    yard.set_title(f"T2 patrols {scene.plan.title}: {rounds}", pad=42)
    _draw_route(yard, scene.route)
    _draw_fixes(yard, recording)
    _draw_rounds(yard, recording)
    _draw_person(yard, recording)
    yard.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=8)
    _draw_margin(margin, scene.route, recording.samples)
    figure.savefig(file, dpi=110)


def _draw_yard(axes: Axes, scene: Scene) -> None:
    for wall in scene.plan.walls:
        xs, ys = zip(*wall.points, strict=True)
        axes.plot(xs, ys, color=INK, linewidth=3, solid_capstyle="projecting")
    for box in scene.plan.boxes:
        corners = [box.pose.outward(x, y) for x, y in box.shape.corners()]
        axes.add_patch(Polygon(corners, edgecolor=INK, facecolor=BOX))
        axes.annotate(box.name, (box.x, box.y), ha="center", va="center", fontsize=8)
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.autoscale(enable=False)
    axes.set(xlabel="x, m", ylabel="y, m")


def _draw_route(axes: Axes, route: m.Route) -> None:
    line, wide = [(each.x, each.y) for each in route.points], route.corridor
    for a, b in pairwise(line):
        length = math.dist(a, b)
        along = Pose((a[0] + b[0]) / 2, (a[1] + b[1]) / 2, math.atan2(b[1] - a[1], b[0] - a[0]))
        band = [along.outward(x, y) for x, y in Rectangle(length / 2, wide).corners()]
        axes.add_patch(Polygon(band, color=CORRIDOR, linewidth=0, zorder=1))
        axes.add_patch(Circle(b, wide, color=CORRIDOR, linewidth=0, zorder=1))
    axes.add_patch(Polygon([line[0]], color=CORRIDOR, label=f"corridor, {wide:g} m to either side"))
    xs, ys = zip(*line, strict=True)
    axes.plot(xs, ys, color=INK, linewidth=1, linestyle="--", zorder=2, label="route")
    middle = (min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2
    for each in route.points:
        if each.station:
            outward = Pose(each.x, each.y, math.atan2(each.y - middle[1], each.x - middle[0]))
            axes.plot(each.x, each.y, "o", color=INK, markersize=7, zorder=6)
            axes.annotate(
                each.station, outward.outward(NAMED, 0.0), ha="center", va="center", fontsize=10,
                fontweight="bold", color=INK,
            )  # fmt: skip


def _draw_fixes(axes: Axes, recording: Recording) -> None:
    xs, ys = zip(*recording.used, strict=True)
    axes.plot(
        xs, ys, ".", color=FIX, markersize=3, zorder=3, label=f"used fixes, {len(recording.used)}"
    )
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    shown = [(x, y) for x, y in recording.refused if left < x < right and low < y < high]
    label = f"refused fixes, {len(recording.refused)}"
    if beyond := len(recording.refused) - len(shown):
        label += f" ({beyond} of them outside of the picture)"
    axes.plot(
        [x for x, _ in shown],
        [y for _, y in shown],
        "x",
        color=REFUSED,
        markersize=8,
        markeredgewidth=2,
        label=label,
    )


def _draw_rounds(axes: Axes, recording: Recording) -> None:
    label = "true path of each round"
    for path in recording.paths:
        xs, ys = zip(*path, strict=True)
        axes.plot(xs, ys, color=TRUE, linewidth=1.2, alpha=0.6, zorder=4, label=label)
        label = ""
    label = "believed pose, two standard deviations"
    for place, covariance in recording.beliefs:
        axes.add_patch(_ellipse(place, covariance, label))
        label = ""


def _ellipse(place: Point, covariance: Covariance, label: str) -> Ellipse:
    mean, half = (covariance.xx + covariance.yy) / 2, (covariance.xx - covariance.yy) / 2
    spread = math.hypot(half, covariance.xy)
    angle = math.degrees(math.atan2(covariance.xy, half) / 2)
    width, height = (4 * math.sqrt(max(0.0, each)) for each in (mean + spread, mean - spread))
    return Ellipse(
        place, width, height, angle=angle, edgecolor=BELIEVED, facecolor="#ef6c0033", zorder=5,
        linewidth=1, label=label,
    )  # fmt: skip


def _draw_person(axes: Axes, recording: Recording) -> None:
    body = Rectangle(Vehicle().length / 2, Vehicle().width / 2)
    for wait in recording.waits:
        outline = [(0.0, 0.0), (body.half_length, 0.0), *body.corners(), (body.half_length, 0.0)]
        xs, ys = zip(*(wait.pose.outward(x, y) for x, y in outline), strict=True)
        axes.plot(xs, ys, color=TRUE, linewidth=1.2, zorder=6)
        if recording.person is not None:
            axes.add_patch(Circle(recording.person, PERSON / 2, color=REFUSED, zorder=6))
            axes.annotate(
                f"a person stands in the way:\nthe vehicle waits {wait.seconds:.0f} s",
                recording.person, (0, 40), textcoords="offset points", ha="center", va="center",
                fontsize=9, color=REFUSED, arrowprops={"arrowstyle": "-", "color": REFUSED},
            )  # fmt: skip


def _draw_margin(axes: Axes, route: m.Route, samples: Sequence[Sample]) -> None:
    labels = ["what patrol compares: deviation + two standard deviations", "true deviation"]
    for number in sorted({each.round for each in samples}):
        of = [each for each in samples if each.round == number]
        xs = [each.progress for each in of]
        claimed = [each.deviation + 2 * each.sigma for each in of]
        axes.plot(xs, claimed, color=BELIEVED, linewidth=1, label=labels[0])
        axes.plot(xs, [each.truth for each in of], color=TRUE, linewidth=1, label=labels[1])
        labels = ["", ""]
    axes.axhspan(0, route.corridor, color=CORRIDOR, linewidth=0)
    axes.axhline(route.corridor, color=INK, linewidth=1)
    axes.annotate("outside of the corridor: it stops", (0.2, route.corridor + 0.02), fontsize=8)
    axes.set(
        xlabel="way from home, m", ylabel="beside the route, m", ylim=(0, route.corridor + 0.15)
    )
    axes.margins(x=0)
    axes.legend(loc="upper right", fontsize=8, ncols=2)
