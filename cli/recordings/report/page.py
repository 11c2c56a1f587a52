"""The report as one HTML page; all content from the bus is escaped."""

from datetime import UTC, datetime
from pathlib import Path

from jinja2 import Environment, StrictUndefined

from cli.inspect.addressing import chunks
from cli.recordings.report import figures
from cli.recordings.report.fixed_labels import chart
from cli.recordings.report.timeline import Timeline
from common.freshness import NS_PER_S
from services.recorder.reader import Reader

TEMPLATE = Path(__file__).with_name("page.html")
EVENTS_MAX = 500


def timeline_of(reader: Reader) -> Timeline:
    """Return the timeline of a recording; raise ``RobotError`` if it is not a recording."""
    timeline = Timeline()
    for recorded in reader:
        timeline.add(recorded.key, recorded.message, recorded.log_ns)
    return timeline


def page(timeline: Timeline, reader: Reader) -> str:
    """Return the page of a recording that has been read to its end."""
    # The fastest streams first, event-driven keys last.
    streams = sorted(timeline.streams.values(), key=lambda each: (-each.expected_hz, each.key))
    names = [chunks(stream.key)[1] or stream.key for stream in streams]
    has_ranges = any(series.times for series in timeline.ranges.values())
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    environment.filters |= {"chart": chart, "clock": clock, "figure": figure, "ms": ms}
    return environment.from_string(TEMPLATE.read_text(encoding="utf-8")).render(
        timeline=timeline,
        title=reader.path.name,
        about=summary(timeline, reader),
        warnings=warnings(timeline, reader),
        streams=list(zip(names, streams, strict=True)),
        events=timeline.events[:EVENTS_MAX],
        path=figures.path(timeline) if timeline.path else "",
        speeds=figures.speeds(timeline),
        ranges=figures.ranges(timeline) if has_ranges else "",
        arrivals=figures.arrivals(timeline, streams, names),
    )


def summary(timeline: Timeline, reader: Reader) -> dict[str, str]:
    """Return the summary at the top of the page, by name."""
    began = datetime.fromtimestamp((timeline.began_ns or 0) / NS_PER_S, UTC)
    robots = sorted({robot for key in timeline.streams if (robot := chunks(key)[0])})
    versions = ", ".join(f"{name} {version}" for name, version in sorted(timeline.versions.items()))
    while_driving = sum(stop.was_driving for stop in timeline.stops)
    return {
        "robot": ", ".join(robots),
        "start": f"{began:%Y-%m-%d %H:%M:%S} UTC",
        "duration": clock(timeline.lasted_s),
        "distance": f"{timeline.distance:.1f} m",
        "stops": f"{len(timeline.stops)}, {while_driving} while driving",
        "services": versions or "no health messages",
        "messages": f"{sum(len(stream.times) for stream in timeline.streams.values())}"
        f" on {len(timeline.streams)} keys",
        "recorded": ", ".join(f"{name} {value}" for name, value in sorted(reader.about.items())),
    }


def warnings(timeline: Timeline, reader: Reader) -> list[str]:
    """Return warnings about an incomplete recording."""
    found = []
    if reader.cut:
        found.append("The file is truncated: its writer was killed, or is still writing.")
    if reader.damaged:
        found.append(f"{reader.damaged} damaged chunks of the file are skipped.")
    undecoded = sum(stream.undecoded for stream in timeline.streams.values())
    if undecoded:
        found.append(f"{undecoded} messages could not be decoded.")
    if len(timeline.events) > EVENTS_MAX:
        found.append(f"The first {EVENTS_MAX} of {len(timeline.events)} events are listed.")
    return found


def clock(seconds: float) -> str:
    """Format a time or a duration."""
    minutes, tenths = divmod(round(10 * seconds), 600)
    return f"{minutes} min {tenths / 10:04.1f} s" if minutes else f"{tenths / 10:.1f} s"


def figure(value: float | None, form: str) -> str:
    """Format a number; empty for None."""
    return "" if value is None else format(value, form)


def ms(seconds: float | None) -> str:
    """Format a duration in milliseconds; empty for None."""
    return "" if seconds is None else f"{1000 * seconds:.1f}"
