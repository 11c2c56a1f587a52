"""Figures of a report, as inline SVG."""

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from io import StringIO

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from cli.recordings.report.stops import Stop
from cli.recordings.report.timeline import Series, Timeline, VelocitySeries, downsampled
from cli.recordings.report.timing import Stream

WIDTH = 11.0  # inches
REQUESTED, ALLOWED, MEASURED, LIMIT = "#6b7683", "#b35900", "#0b62c4", "#e6eaee"
STOPPED, TEXT, MUTED = "#cf1f26", "#0a0e13", "#8a939c"
VERDICTS = {
    "run": "#1a7f37", "slow": "#f0b429", "stop": "#8a939c", "brake": "#cf1f26",
    "inhibited": "#7a3fd0",
}  # fmt: skip
LEVELS = {"info": MUTED, "warning": "#b35900", "error": STOPPED}
FRONT = ("front_left", "front", "front_right")


def path(timeline: Timeline) -> str:
    """Draw the path by odometry, with the numbered stops."""

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for number, segment in enumerate(timeline.path):
            xs, ys = downsampled(segment.xs, segment.ys)
            axes.plot(xs, ys, color=MEASURED, linewidth=1.6)
            _mark(axes, (xs[0], ys[0]), "o", "start" if number == 0 else "odometry restart")
            if number == len(timeline.path) - 1:
                _mark(axes, (xs[-1], ys[-1]), "s", "end")
        for number, stop in enumerate(timeline.stops, 1):
            place = place_at(timeline, stop.begins_s)
            if place:
                axes.plot(*place, "x", color=STOPPED, markersize=8)
                axes.annotate(f" {number}", place, color=STOPPED, weight="bold")
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_xlabel("x in odom, m")
        axes.set_ylabel("y in odom, m")

    return svg(draw, 6.0, "path")


def speeds(timeline: Timeline) -> str:
    """Draw linear and angular velocity over time, with verdicts and events."""

    def draw(figure: Figure) -> None:
        linear, angular, verdicts, events = figure.subplots(
            4, 1, sharex=True, height_ratios=[5, 5, 1, 1.4]
        )
        _draw_velocity(linear, timeline.linear, "linear, m/s")
        _draw_velocity(angular, timeline.angular, "angular, rad/s")
        linear.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
        for axes in (linear, angular):
            _shade(axes, timeline.stops)
        _draw_verdicts(verdicts, timeline)
        _draw_events(events, timeline)
        _set_time(events, timeline)

    return svg(draw, 7.0, "speeds")


def ranges(timeline: Timeline) -> str:
    """Draw the eight sonar ranges over time, and when the bumper was pressed."""

    def draw(figure: Figure) -> None:
        front, rest = figure.subplots(2, 1, sharex=True)
        for name, series in timeline.ranges.items():
            axes = front if name in FRONT else rest
            _plot(axes, series, label=name.replace("_", " "), linewidth=1.0)
        for axes in (front, rest):
            for phase in timeline.pressed.done:
                if phase.state:
                    axes.axvspan(phase.begins_s, phase.ends_s, color=STOPPED, alpha=0.5)
            axes.set_ylabel("range, m")
            axes.set_ylim(bottom=0)
            axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
        _set_time(rest, timeline)

    return svg(draw, 5.0, "ranges")


def arrivals(timeline: Timeline, streams: Sequence[Stream], names: Sequence[str]) -> str:
    """Draw the arrivals of each stream, one row each, with gaps in red."""

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for row, stream in enumerate(streams):
            if not stream.expected_hz:  # event-driven
                axes.plot(stream.times, [row] * len(stream.times), "|", color=MEASURED)
                continue
            axes.hlines(row, stream.times[0], stream.times[-1], color=MEASURED, linewidth=4)
            for begins_s, ends_s in stream.gaps:
                axes.hlines(row, begins_s, ends_s, color="white", linewidth=4)
                axes.hlines(row, begins_s, ends_s, color=STOPPED, linewidth=2)
        axes.set_yticks(range(len(streams)), names)
        axes.invert_yaxis()
        _set_time(axes, timeline)

    return svg(draw, 1.2 + 0.24 * len(streams), "arrivals")


def place_at(timeline: Timeline, at_s: float) -> tuple[float, float] | None:
    """Return the last odometry position at that time; None before the first."""
    for segment in reversed(timeline.path):
        index = bisect_right(segment.times, at_s) - 1
        if index >= 0:
            return segment.xs[index], segment.ys[index]
    return None


def svg(draw: Callable[[Figure], None], height: float, name: str) -> str:
    """Return a figure as an SVG element, ``height`` in inches; its ids begin with the name."""
    # Text stays text: it is searchable and accessible. A `$` in a name is not a formula.
    with mpl.rc_context(
        {"svg.fonttype": "none", "svg.hashsalt": name, "text.parse_math": False, "font.size": 9}
    ):
        figure = Figure(figsize=(WIDTH, height), layout="constrained")
        FigureCanvasSVG(figure)
        draw(figure)
        for axes in figure.axes:
            axes.grid(alpha=0.25)
            axes.spines[["top", "right"]].set_visible(False)
        text = StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    document = text.getvalue()
    return document[document.index("<svg") :]


def _draw_velocity(axes: Axes, series: VelocitySeries, label: str) -> None:
    times, upper = downsampled(series.upper.times, series.upper.values)
    lower_times, lower = downsampled(series.lower.times, series.lower.values)
    axes.plot(times, upper, color=LIMIT, linewidth=2, label="safety's limits")
    axes.plot(lower_times, lower, color=LIMIT, linewidth=2)
    styles = ("-", "--", ":", "-.")
    for number, (source, request) in enumerate(series.requested.items()):
        _plot(
            axes,
            request,
            color=REQUESTED,
            linestyle=styles[number % 4],
            label=f"requested by {source}",
        )
    _plot(axes, series.allowed, color=ALLOWED, label="allowed by safety")
    _plot(axes, series.measured, color=MEASURED, label="measured")
    axes.set_ylabel(label)


def _draw_verdicts(axes: Axes, timeline: Timeline) -> None:
    for phase in timeline.verdicts.done:
        axes.axvspan(phase.begins_s, phase.ends_s, color=VERDICTS[phase.state.verdict], linewidth=0)
    verdicts = dict.fromkeys(phase.state.verdict for phase in timeline.verdicts.done)
    for verdict in verdicts:
        axes.plot([], [], color=VERDICTS[verdict], linewidth=6, label=verdict)
    if verdicts:
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.3), frameon=False, fontsize=8)
    axes.set_yticks([])
    axes.set_ylabel("verdict", rotation=0, ha="right", va="center")


def _draw_events(axes: Axes, timeline: Timeline) -> None:
    services = sorted({each.service for each in timeline.events})
    for each in timeline.events:
        row = services.index(each.service)
        axes.plot(each.at_s, row, "|", color=LEVELS[each.event.level], markersize=9)
    axes.set_yticks(range(len(services)), services, fontsize=7)
    axes.set_ylim(len(services) - 0.5, -0.5)
    axes.set_ylabel("events", rotation=0, ha="right", va="center", labelpad=24)


def _shade(axes: Axes, stops: Iterable[Stop]) -> None:
    for number, stop in enumerate(stops, 1):
        axes.axvspan(stop.begins_s, stop.ends_s, color=STOPPED, alpha=0.08, linewidth=0)
        axes.annotate(
            str(number), (stop.begins_s, 1), xycoords=("data", "axes fraction"), fontsize=8,
            color=STOPPED, weight="bold", va="bottom",
        )  # fmt: skip


def _mark(axes: Axes, place: tuple[float, float], marker: str, label: str) -> None:
    axes.plot(*place, marker, color=TEXT, markersize=6)
    axes.annotate(label, place, xytext=(6, 6), textcoords="offset points", color=TEXT)


def _plot(axes: Axes, series: Series, **style: object) -> None:
    times, values = downsampled(series.times, series.values)
    axes.plot(times, values, **{"linewidth": 1.2, **style})  # type: ignore[arg-type]


def _set_time(axes: Axes, timeline: Timeline) -> None:
    axes.set_xlim(0, max(timeline.lasted_s, math.ulp(1.0)))
    axes.set_xlabel("time, s")
