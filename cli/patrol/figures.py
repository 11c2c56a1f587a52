"""Figures of a round, as inline SVG: the path in its corridor, and the uncertainty on the way."""

import math
from collections.abc import Sequence
from itertools import accumulate, pairwise

import ziaplot as zp
from ziaplot.canvas import Borders, Canvas, ViewBox

from cli.recordings.figures import (
    ELLIPSE,
    MEASURED,
    PLAN,
    REQUESTED,
    STOPPED,
    fit,
    mark,
    svg,
)
from cli.recordings.timeline import downsampled
from t2 import messages as m

CORRIDOR = "#dbe7f5"
HEIGHT = 320  # pixels


class Band(zp.PolyLine):
    """A line with a width in the units of the axes; the page rounds its ends and corners."""

    def __init__(self, xs: Sequence[float], ys: Sequence[float], width: float) -> None:
        super().__init__(xs, ys)
        self._xs, self._ys, self._width = xs, ys, width

    def _xml(
        self, canvas: Canvas, databox: ViewBox | None = None, borders: Borders | None = None
    ) -> None:
        scale = 1.0 if databox is None else canvas.viewbox.w / databox.w
        color, width = self._build_style().get_color(), self._width * scale
        canvas.path(self._xs, self._ys, color=color, width=width, dataview=databox)


def path(found: m.Round, route: m.Route, track: Sequence[m.TrackPoint]) -> str:
    """Draw the corridor, the taught and the driven path, the stations and the numbered halts."""
    xs, ys = [each.x for each in route.points], [each.y for each in route.points]
    graph = zp.Graph()
    graph.axesnames("x in map, m", "y in map, m")
    graph.add(Band(xs, ys, 2 * route.corridor).color(CORRIDOR))
    graph.add(zp.PolyLine(xs, ys).color(REQUESTED).strokewidth(1).stroke("--"))
    if len(track) > 1:
        line = zp.PolyLine([each.x for each in track], [each.y for each in track])
        graph.add(line.color(MEASURED).strokewidth(1.6))
    for point in route.points:
        if point.station:
            mark(graph, (point.x, point.y), "round", point.station)
    for number, halt in enumerate(found.halts, 1):
        cross = zp.Point((halt.x, halt.y)).marker("x", 5)
        graph.add(cross.label(str(number), "SE").color(STOPPED))
    wide = [side * route.corridor for side in (-1, 1)]
    fit(
        graph,
        [x + each for x in xs for each in wide] + [each.x for each in track],
        [y + each for y in ys for each in wide] + [each.y for each in track],
    )
    return svg(graph, PLAN, "path")


def uncertainty(route: m.Route, track: Sequence[m.TrackPoint]) -> str:
    """Draw the deviation, and with twice its standard deviation, over the driven way."""
    steps = [math.dist((a.x, a.y), (b.x, b.y)) for a, b in pairwise(track)]
    way = [0.0, *accumulate(steps)]
    graph = zp.Graph()
    graph.axesnames("driven, m", "m")
    graph.legend("right")
    sums = [each.deviation + 2 * each.sigma for each in track]
    xs, ys = downsampled(way, sums)
    graph.add(zp.PolyLine(xs, ys).name("deviation + 2 sigma").color(ELLIPSE).strokewidth(1.6))
    xs, ys = downsampled(way, [each.deviation for each in track])
    graph.add(zp.PolyLine(xs, ys).name("deviation").color(MEASURED).strokewidth(1.2))
    line = zp.PolyLine([0.0, way[-1]], [route.corridor] * 2)
    graph.add(line.name("corridor").color(STOPPED).strokewidth(1.2).stroke("--"))
    graph.xrange(0.0, way[-1] or 1.0)
    graph.yrange(0.0, 1.1 * max(route.corridor, *sums))
    return svg(graph, HEIGHT, "uncertainty")
