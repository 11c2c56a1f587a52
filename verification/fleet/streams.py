"""Streams of a robot, recorded on a lap: real sizes, shipped rates. Pure.

The recording has no health messages: they are made up, with full histograms of a bridge.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from common import keys
from common.keys import Topic
from common.messages import Durations, Health, Message, Timing
from services.bridge.timing import BOUNDS_NS, REACTIONS

SERVICES = ("bridge", "safety", "odom", "recorder")
UPWARD = "tel/"  # what a site receives; commands stay on the robot


@dataclass(frozen=True, slots=True)
class Stream:
    """One key of a robot."""

    topic: Topic[Message]
    message: Message
    raw: bytes | None = None  # the attached frame of the board
    names: Mapping[str, str] = field(default_factory=dict)

    @property
    def path(self) -> str:
        """The key below the robot."""
        return self.topic.path.format(**self.names)


def streams(recorded: Iterable[tuple[str, Message, bytes | None]]) -> list[Stream]:
    """Return a robot's streams: the last recorded message of each path, and health messages."""
    last = {path: (message, raw) for path, message, raw in recorded}
    made = [
        Stream(topic, *last[topic.path.format(**names)], names)
        for topic in keys.TOPICS
        if topic.path.startswith(UPWARD) and topic is not keys.HEALTH
        for names in _names(topic)
    ]
    return made + [
        Stream(keys.HEALTH, health(name, made), None, {"service": name})  # type: ignore[arg-type]
        for name in SERVICES
    ]


def schedule(all_streams: Sequence[Stream], robots: int) -> list[tuple[float, int, int]]:
    """Return one second of all robots: time, robot, stream; evenly spread."""
    slots = []
    for robot in range(robots):
        for number, stream in enumerate(all_streams):
            shift = (robot / robots + number / len(all_streams)) % 1.0
            rate = round(stream.topic.rate_hz)
            slots += [((n + shift) / rate, robot, number) for n in range(rate)]
    return sorted(slots)


def health(service: str, made: Sequence[Stream]) -> Health:
    """Return a health message."""
    rates = {stream.topic.on("berlin-001", **stream.names): 50.123456 for stream in made}
    return Health(
        service=service, version="0.1.0", uptime=12_345.6, lateness=0.0012, rss=45_000_000,
        rates=rates, counters={"overrun": 3, "undecodable": 0},
        timing=histograms() if service == "bridge" else None,
    )  # fmt: skip


def histograms() -> Timing:
    """Return a bridge's reaction times after some hours."""
    counts = tuple(n * 37 % 1000 for n in range(len(BOUNDS_NS) + 1))
    return Timing(
        bounds=tuple(bound / 1e9 for bound in BOUNDS_NS),
        durations={
            name: Durations(counts=counts, worst=0.0123) for r in REACTIONS for name in r.names
        },
        not_counted={"foreign_clock": 12_345},
    )


def downsampling(
    robot: str, all_streams: Sequence[Stream], most_hz: float
) -> list[dict[str, object]]:
    """Return Zenoh's downsampling rules of a robot's uplink.

    Zenoh keeps one timer for each rule, so each key needs its own rule.
    """
    rules = [
        {"key_expr": stream.topic.on(robot, **stream.names), "freq": most_hz}
        for stream in all_streams
        if stream.topic.rate_hz > most_hz
    ]
    return [{"id": "uplink", "flows": ["egress"], "messages": ["put"], "rules": rules}]


def _names(topic: Topic[Message]) -> Iterator[dict[str, str]]:
    yield from [{"side": "left"}, {"side": "right"}] if "{side}" in topic.path else [{}]
