"""A recording's story as one HTML page; what came from the bus is text there, never markup."""

from datetime import UTC, datetime
from pathlib import Path

from jinja2 import Environment, StrictUndefined

from cli.inspect.addressing import chunks
from cli.latency import NAMES
from cli.recordings.report import figures
from cli.recordings.report.reactions import Reaction, reactions
from cli.recordings.report.story import Story
from cli.recordings.report.streams import Stream
from common.freshness import NS_PER_S
from services.recorder.reader import Reader

TEMPLATE = Path(__file__).with_name("page.html")
EVENTS_MOST = 500


def told(reader: Reader) -> Story:
    """Return what a recording tells; raise ``RobotError`` when it is none."""
    story = Story()
    for recorded in reader:
        story.hear(recorded.key, recorded.message, recorded.log_ns)
    return story


def page(story: Story, reader: Reader) -> str:
    """Return the page of a recording that was read to its end."""
    streams = sorted(story.streams.values(), key=lambda stream: (order(stream), stream.key))
    names = [chunks(stream.key)[1] or stream.key for stream in streams]
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    environment.filters |= {"clock": clock, "figure": figure, "ms": ms}
    return environment.from_string(TEMPLATE.read_text(encoding="utf-8")).render(
        story=story,
        title=reader.path.name,
        about=facts(story, reader),
        warnings=warnings(story, reader),
        streams=list(zip(names, streams, strict=True)),
        reactions=[(words(one.name), "." in one.name, one) for one in measured(story)],
        events=story.events[:EVENTS_MOST],
        path=figures.path(story) if story.path else "",
        speeds=figures.speeds(story),
        ranges=figures.ranges(story) if any_range(story) else "",
        arrivals=figures.arrivals(story, streams, names),
    )


def facts(story: Story, reader: Reader) -> dict[str, str]:
    """Return what stands at the top, by name."""
    began = datetime.fromtimestamp((story.began_ns or 0) / NS_PER_S, UTC)
    robots = sorted({robot for key in story.streams if (robot := chunks(key)[0])})
    versions = ", ".join(f"{name} {version}" for name, version in sorted(story.versions.items()))
    return {
        "robot": ", ".join(robots),
        "began": f"{began:%Y-%m-%d %H:%M:%NS_PER_S} UTC",
        "lasted": clock(story.lasted_s),
        "driven": f"{story.distance:.1f} m",
        "stops": f"{len(story.stops)}, {sum(stop.was_driving for stop in story.stops)} of them "
        "while driving",
        "services": versions or "none told its health",
        "messages": f"{sum(len(stream.times) for stream in story.streams.values())}"
        f" on {len(story.streams)} keys",
        "recorded": ", ".join(f"{name} {value}" for name, value in sorted(reader.about.items())),
    }


def warnings(story: Story, reader: Reader) -> list[str]:
    """Return what is missing of the recording, in words."""
    found = []
    if reader.cut:
        found.append("The file has no end: its writer was killed, or is still writing.")
    if reader.damaged:
        found.append(f"{reader.damaged} damaged pieces of the file are left out.")
    unread = sum(stream.unread for stream in story.streams.values())
    if unread:
        found.append(f"{unread} messages could not be read as what they say they are.")
    if len(story.events) > EVENTS_MOST:
        found.append(f"Of {len(story.events)} events the first {EVENTS_MOST} are listed.")
    return found


def measured(story: Story) -> list[Reaction]:
    """Return the bridge's reaction times."""
    return reactions(ends for (service, _), ends in story.healths.items() if service == "bridge")


def words(name: str) -> str:
    """Return the name of a reaction, or of a hop in one, for people."""
    last = name.rpartition(".")[2]
    return NAMES.get(last, last)


def any_range(story: Story) -> bool:
    """Tell whether the sonars were heard."""
    return any(series.times for series in story.ranges.values())


def order(stream: Stream) -> float:
    """Return a sort key: the fastest first, what has no rate last."""
    return -stream.expected_hz


def clock(seconds: float) -> str:
    """Return a time in the recording, or a length, for people."""
    minutes, rest = divmod(seconds, 60)
    return f"{minutes:.0f} min {rest:04.1f} s" if minutes else f"{rest:.1f} s"


def figure(value: float | None, form: str) -> str:
    """Return a number, or nothing where there is none."""
    return "" if value is None else format(value, form)


def ms(seconds: float | None) -> str:
    """Return a duration in milliseconds, or nothing."""
    return "" if seconds is None else f"{1000 * seconds:.1f}"
