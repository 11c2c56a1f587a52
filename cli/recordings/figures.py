"""Figures of a report, as inline SVG without scripts."""

import math
import re
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import TypeVar

import ziaplot as zp
from ziaplot.canvas import Borders, Canvas, ViewBox
from ziaplot.style import DashTypes, MarkerTypes

from cli.recordings.path import PathSegment
from cli.recordings.timeline import Series, Timeline, VelocitySeries, downsampled

WIDTH = 1100  # pixels
REQUESTED, ALLOWED, MEASURED = "#6b7683", "#b35900", "#0b62c4"
STOPPED, TEXT = "#cf1f26", "#0a0e13"
VERDICTS = {
    "run": "#1a7f37", "slow": "#f0b429", "stop": "#8a939c", "brake": "#cf1f26",
    "inhibited": "#7a3fd0",
}  # fmt: skip
MAP_STATES = {"placed": "#1a7f37", "unplaced": "#8a939c", "lost": "#cf1f26"}
ELLIPSE, USED, REFUSED = "#b35900", "#1a7f37", "#7a3fd0"
SIGMAS = 2.0  # of an ellipse
DASHES: tuple[DashTypes, ...] = ("-", "--", ":", "-.")
PLAN = 560  # pixels, height of a figure of a path
PATH_ASPECT = 2.0  # width by height
BEYOND = 1000.0  # outside each axis; figures are clipped

T = TypeVar("T")

zp.config.text = "text"  # searchable, and a `$` in a name is not a formula
zp.config.precision = 1  # of a pixel
zp.css("""
    Graph { color: none; edge_width: 1; }
    Graph.GridX { color: #e3e7eb; stroke: solid; }
    Graph.GridY { color: #e3e7eb; stroke: solid; }
    Graph.TickX { font_size: 12; height: 4; stroke_width: 1; pad: 0; }
    Graph.TickY { font_size: 12; height: 4; stroke_width: 1; pad: 0.1; }
    Graph.XName { font_size: 12; }
    Graph.YName { font_size: 12; }
    Graph.Legend { stroke: none; edge_color: none; edge_width: 12; font_size: 12; radius: 24; }
    Graph.LegendText { font_size: 12; }
    Point { edge_width: 0; }
    Scatter { edge_width: 0; }
    Point.Text { font_size: 12; margin: 8; }
    Text { font_size: 12; }
""")


class BrokenLine(zp.PolyLine):
    """A series with a gap at each NaN, and 0 on both axes; ziaplot's own line has no gaps.

    A line for each part would take seconds: ziaplot resolves the style of each element.
    """

    def __init__(self, series: Series) -> None:
        points = zip(*downsampled(series.times, series.values), strict=True)
        parts = groupby(points, lambda point: not math.isnan(point[1]))
        self._parts = [tuple(zip(*part, strict=True)) for known, part in parts if known]
        times, values = ([n for part in self._parts for n in part[axis]] for axis in (0, 1))
        super().__init__([0.0, *times], [0.0, *values])

    def _xml(
        self, canvas: Canvas, databox: ViewBox | None = None, borders: Borders | None = None
    ) -> None:
        style = self._build_style()
        for times, values in self._parts:
            canvas.path(
                times, values, color=style.get_color(), width=style.stroke_width,
                stroke=style.stroke, dataview=databox, zorder=self._zorder,
            )  # fmt: skip


def path(timeline: Timeline) -> str:
    """Draw the path by odometry, with the numbered stops."""
    graph = _plan("odom", timeline.path, "odometry restart")
    _stops(graph, timeline, timeline.path)
    return svg(graph, PLAN, "path")


def map_path(timeline: Timeline) -> str:
    """Draw the path in the map, with stops, ellipses and fixes."""
    track = timeline.map
    graph = _plan("map", track.path, "placed")
    for each in _thinned(track.ellipses):
        axis, other, direction = each.axes
        ellipse = zp.Ellipse(
            (each.x, each.y), SIGMAS * axis, SIGMAS * other, math.degrees(direction)
        )
        graph.add(ellipse.color(ELLIPSE).strokewidth(1))
    _scatter(graph, [(it.x, it.y) for it in track.fixes if it.used], "round", USED)
    _scatter(graph, [(it.x, it.y) for it in track.fixes if not it.used], "x", REFUSED)
    _stops(graph, timeline, track.path)
    return svg(graph, PLAN, "map")


def _plan(frame: str, path: Sequence[PathSegment], begins: str) -> zp.Graph:
    graph = zp.Graph()
    graph.axesnames(f"x in {frame}, m", f"y in {frame}, m")
    for number, segment in enumerate(path):
        xs, ys = downsampled(segment.xs, segment.ys)
        graph.add(zp.PolyLine(xs, ys).color(MEASURED).strokewidth(1.6))
        mark(graph, (xs[0], ys[0]), "round", "start" if number == 0 else begins)
        if number == len(path) - 1:
            mark(graph, (xs[-1], ys[-1]), "square", "end")
    fit(graph, [x for each in path for x in each.xs], [y for each in path for y in each.ys])
    return graph


def _stops(graph: zp.Graph, timeline: Timeline, path: Sequence[PathSegment]) -> None:
    for number, stop in enumerate(timeline.stops, 1):
        place = place_at(path, stop.begins_s)
        if place:
            graph.add(zp.Point(place).marker("x", 5).label(str(number), "SE").color(STOPPED))


def _scatter(
    graph: zp.Graph, places: Sequence[tuple[float, float]], marker: MarkerTypes, color: str
) -> None:
    if places:
        xs, ys = zip(*_thinned(places), strict=True)
        graph.add(zp.Scatter(xs, ys).marker(marker, 3).color(color))


def _thinned(places: Sequence[T], limit: int = 1000) -> Sequence[T]:
    return places[:: math.ceil(len(places) / limit) or 1]


def speeds(timeline: Timeline) -> str:
    """Draw linear and angular velocity over time, with the verdicts."""
    rows = [
        _velocity(timeline, timeline.linear, "linear, m/s"),
        _velocity(timeline, timeline.angular, "angular, rad/s"),
    ]
    heights, states = "8fr 8fr 2fr", timeline.map.states
    if states:
        heights = "8fr 8fr 1.6fr 2fr"
        bands = [(each.begins_s, each.ends_s, each.state) for each in states]
        rows.append(_band(timeline, "map", bands, MAP_STATES))
    verdicts = [(each.begins_s, each.ends_s, each.state.verdict) for each in timeline.verdicts]
    rows.append(_band(timeline, "verdict", verdicts, VERDICTS, "time, s"))
    return svg(zp.LayoutV(*rows, row_gap=4, row_heights=heights), 690 if states else 620, "speeds")


def place_at(path: Sequence[PathSegment], at_s: float) -> tuple[float, float] | None:
    """Return the last position of a path at that time; None before the first."""
    for segment in reversed(path):
        index = bisect_right(segment.times, at_s) - 1
        if index >= 0:
            return segment.xs[index], segment.ys[index]
    return None


def svg(drawing: zp.Graph | zp.LayoutV, height: float, name: str) -> str:
    """Return a drawing as an SVG element, ``height`` in pixels; its ids begin with the name."""
    drawing.size(WIDTH, height)
    # The page contains several figures, and ids are unique in a page.
    unique = re.sub(r'( id="|"url\(#)', rf"\1{name}-", drawing.tosvg())
    unique = re.sub(r'( d="M[^"L]*) L "', r'\1"', unique)  # a single point, invalid with its "L"
    return re.sub(r">-?[\d.]+e-1\d<", ">0<", unique)  # a tick label that rounding keeps off zero


def _over_time(timeline: Timeline, y_name: str | None, x_name: str | None = None) -> zp.Graph:
    graph = zp.Graph()
    graph.axesnames(x_name, y_name)
    graph.legend("right")
    graph.xrange(0.0, timeline.lasted_s or 1.0)
    if not x_name:  # the graph below it has the same axis
        graph.noxticks()
    return graph


def _velocity(timeline: Timeline, series: VelocitySeries, label: str) -> zp.Graph:
    graph = _over_time(timeline, label)
    for number, (source, request) in enumerate(series.requested.items()):
        _line(graph, request, REQUESTED, f"requested by {source}", dash=DASHES[number % 4])
    _line(graph, series.allowed, ALLOWED, "allowed by safety")
    _line(graph, series.measured, MEASURED, "measured")
    top = graph.datarange().ymax
    for number, stop in enumerate(timeline.stops, 1):
        _span(graph, stop.begins_s, stop.ends_s, f"{STOPPED} 8%")
        graph.add(zp.Text(stop.begins_s, top, str(number), valign="top").color(STOPPED))
    return graph


def _band(
    timeline: Timeline,
    name: str,
    bands: Sequence[tuple[float, float, str]],
    colors: Mapping[str, str],
    x_name: str | None = None,
) -> zp.Graph:
    graph = _over_time(timeline, None, x_name)
    graph.css("Graph.GridY { color: none; }")
    graph.yrange(-0.5, 0.5)
    graph.yticks([0], [name])
    for begins_s, ends_s, state in bands:
        _span(graph, begins_s, ends_s, colors[state])
    for state in dict.fromkeys(state for *_, state in bands):
        _line(graph, Series(), colors[state], state, width=6)
    return graph


def _line(
    graph: zp.Graph,
    series: Series,
    color: str,
    label: str,
    *,
    width: float = 1.2,
    dash: DashTypes = "-",
) -> None:
    line = BrokenLine(series)
    graph.add(line.name(label).color(color).strokewidth(width).stroke(dash))


def _span(graph: zp.Graph, begins_s: float, ends_s: float, color: str) -> None:
    """Shade a period over the graph's full height."""
    span = zp.Rectangle(begins_s, -BEYOND, ends_s - begins_s, 2 * BEYOND)
    graph.add(span.fill(color).color("none"))


def mark(graph: zp.Graph, place: tuple[float, float], shape: MarkerTypes, label: str) -> None:
    """Add a point with its name."""
    graph.add(zp.Point(place).marker(shape, 4).label(label).color(TEXT))


def fit(graph: zp.Graph, xs: Sequence[float], ys: Sequence[float]) -> None:
    """Show a whole path in a frame of ``PATH_ASPECT``, with equal scales."""
    left, right, bottom, top = min(xs), max(xs), min(ys), max(ys)
    height = 1.1 * max((right - left) / PATH_ASPECT, top - bottom, 0.1)
    width = PATH_ASPECT * height
    graph.xrange((left + right - width) / 2, (left + right + width) / 2)
    graph.yrange((bottom + top - height) / 2, (bottom + top + height) / 2)
    graph.equal_aspect()
