"""The figures of a report, as SVG that stands in a page."""

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from io import StringIO

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from cli.recordings.report.downsampling import thinned
from cli.recordings.report.stops import Stop
from cli.recordings.report.story import Motions, Series, Story
from cli.recordings.report.streams import Stream

WIDE = 11.0  # inches
ASKED, ALLOWED, MEASURED, LIMIT = "#6b7683", "#b35900", "#0b62c4", "#e6eaee"
STOPPED, INK, QUIET = "#cf1f26", "#0a0e13", "#8a939c"
VERDICTS = {
    "run": "#1a7f37", "slow": "#f0b429", "stop": "#8a939c", "brake": "#cf1f26",
    "inhibited": "#7a3fd0",
}  # fmt: skip
LEVELS = {"info": QUIET, "warning": "#b35900", "error": STOPPED}
FRONT = ("front_left", "front", "front_right")


def path(story: Story) -> str:
    """Draw the way that odometry tells, with the places of the stops by their numbers."""

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for number, stretch in enumerate(story.path):
            xs, ys = thinned(stretch.xs, stretch.ys)
            axes.plot(xs, ys, color=MEASURED, linewidth=1.6)
            _mark(axes, (xs[0], ys[0]), "o", "start" if number == 0 else "odometry anew")
            if number == len(story.path) - 1:
                _mark(axes, (xs[-1], ys[-1]), "s", "end")
        for number, stop in enumerate(story.stops, 1):
            place = place_at(story, stop.begins_s)
            if place:
                axes.plot(*place, "x", color=STOPPED, markersize=8)
                axes.annotate(f" {number}", place, color=STOPPED, weight="bold")
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_xlabel("x in odom, m")
        axes.set_ylabel("y in odom, m")

    return svg(draw, 6.0, "path")


def speeds(story: Story) -> str:
    """Draw both components of the motion over time, above the verdicts and the events."""

    def draw(figure: Figure) -> None:
        linear, angular, verdicts, events = figure.subplots(
            4, 1, sharex=True, height_ratios=[5, 5, 1, 1.4]
        )
        _draw_motions(linear, story.linear, "linear, m/s")
        _draw_motions(angular, story.angular, "angular, rad/s")
        linear.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
        for axes in (linear, angular):
            _shade(axes, story.stops)
        _draw_verdicts(verdicts, story)
        _draw_events(events, story)
        _set_time(events, story)

    return svg(draw, 7.0, "speeds")


def ranges(story: Story) -> str:
    """Draw the eight ranges over time, and when the bumper was pressed."""

    def draw(figure: Figure) -> None:
        front, rest = figure.subplots(2, 1, sharex=True)
        for name, series in story.ranges.items():
            axes = front if name in FRONT else rest
            _plot(axes, series, label=name.replace("_", " "), linewidth=1.0)
        for axes in (front, rest):
            for phase in story.pressed.done:
                if phase.state:
                    axes.axvspan(phase.begins_s, phase.ends_s, color=STOPPED, alpha=0.5)
            axes.set_ylabel("range, m")
            axes.set_ylim(bottom=0)
            axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
        _set_time(rest, story)

    return svg(draw, 5.0, "ranges")


def arrivals(story: Story, streams: Sequence[Stream], names: Sequence[str]) -> str:
    """Draw when each stream came, a row each, and in red where it did not."""

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for row, stream in enumerate(streams):
            if not stream.expected_hz:  # it comes when something happens
                axes.plot(stream.times, [row] * len(stream.times), "|", color=MEASURED)
                continue
            axes.hlines(row, stream.times[0], stream.times[-1], color=MEASURED, linewidth=4)
            for begins_s, ends_s in stream.gaps:
                axes.hlines(row, begins_s, ends_s, color="white", linewidth=4)
                axes.hlines(row, begins_s, ends_s, color=STOPPED, linewidth=2)
        axes.set_yticks(range(len(streams)), names)
        axes.invert_yaxis()
        _set_time(axes, story)

    return svg(draw, 1.2 + 0.24 * len(streams), "arrivals")


def place_at(story: Story, at_s: float) -> tuple[float, float] | None:
    """Return where odometry saw the vehicle last by then; None before it saw it."""
    for stretch in reversed(story.path):
        index = bisect_right(stretch.times, at_s) - 1
        if index >= 0:
            return stretch.xs[index], stretch.ys[index]
    return None


def svg(draw: Callable[[Figure], None], high: float, name: str) -> str:
    """Return a drawing as an SVG element, ``high`` inches of it; its ids begin with the name."""
    # Words stay words: they can be searched, and read aloud. Nobody's name is mathematics.
    with mpl.rc_context(
        {"svg.fonttype": "none", "svg.hashsalt": name, "text.parse_math": False, "font.size": 9}
    ):
        figure = Figure(figsize=(WIDE, high), layout="constrained")
        FigureCanvasSVG(figure)
        draw(figure)
        for axes in figure.axes:
            axes.grid(alpha=0.25)
            axes.spines[["top", "right"]].set_visible(False)
        text = StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    whole = text.getvalue()
    return whole[whole.index("<svg") :]


def _draw_motions(axes: Axes, motions: Motions, label: str) -> None:
    times, upper = thinned(motions.upper.times, motions.upper.values)
    lower_times, lower = thinned(motions.lower.times, motions.lower.values)
    axes.plot(times, upper, color=LIMIT, linewidth=2, label="safety's limits")
    axes.plot(lower_times, lower, color=LIMIT, linewidth=2)
    styles = ("-", "--", ":", "-.")
    for number, (source, series) in enumerate(motions.asked.items()):
        _plot(axes, series, color=ASKED, linestyle=styles[number % 4], label=f"asked by {source}")
    _plot(axes, motions.allowed, color=ALLOWED, label="allowed by safety")
    _plot(axes, motions.measured, color=MEASURED, label="measured")
    axes.set_ylabel(label)


def _draw_verdicts(axes: Axes, story: Story) -> None:
    for phase in story.verdicts.done:
        axes.axvspan(phase.begins_s, phase.ends_s, color=VERDICTS[phase.state.verdict], linewidth=0)
    told = dict.fromkeys(phase.state.verdict for phase in story.verdicts.done)
    for verdict in told:
        axes.plot([], [], color=VERDICTS[verdict], linewidth=6, label=verdict)
    if told:
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.3), frameon=False, fontsize=8)
    axes.set_yticks([])
    axes.set_ylabel("verdict", rotation=0, ha="right", va="center")


def _draw_events(axes: Axes, story: Story) -> None:
    services = sorted({told.service for told in story.events})
    for told in story.events:
        row = services.index(told.service)
        axes.plot(told.at_s, row, "|", color=LEVELS[told.event.level], markersize=9)
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


def _mark(axes: Axes, place: tuple[float, float], marker: str, word: str) -> None:
    axes.plot(*place, marker, color=INK, markersize=6)
    axes.annotate(word, place, xytext=(6, 6), textcoords="offset points", color=INK)


def _plot(axes: Axes, series: Series, **style: object) -> None:
    times, values = thinned(series.times, series.values)
    axes.plot(times, values, **{"linewidth": 1.2, **style})  # type: ignore[arg-type]


def _set_time(axes: Axes, story: Story) -> None:
    axes.set_xlim(0, max(story.lasted_s, math.ulp(1.0)))
    axes.set_xlabel("time, s")
