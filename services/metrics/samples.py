"""Prometheus samples of the robots.

Each number of a stream is a gauge, ``t2_STREAM_FIELD`` with its base unit. Words and maps of
numbers have the label ``name``. None and stale values have no sample; ``t2_robot_up`` and
``t2_service_up`` report them.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, get_args

from msgspec import Struct
from msgspec.structs import replace
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric

from common.pose import Covariance
from services.metrics.robot import RobotState
from t2 import keys
from t2.messages import Durations, LinkState, MapPose, MapState, Message, RoundState, Verdict

STREAMS: dict[str, keys.Topic[Any]] = {
    "safety": keys.SAFETY,
    "link": keys.LINK,
    "odometry": keys.ODOMETRY,
    "localization": keys.MAP_POSE,
    "patrol": keys.PATROL,
}
UNITS = {
    "progress": "_meters", "length": "_meters", "deviation": "_meters", "sigma": "_meters",
    "corridor": "_meters",
    "x": "_meters", "y": "_meters", "residual": "_meters", "heading": "_radians",
    "linear": "_meters_per_second", "forward": "_meters_per_second",
    "backward": "_meters_per_second", "angular": "_radians_per_second",
    "round_trip": "_seconds", "uptime": "_seconds", "lateness": "_seconds", "age": "_seconds",
    "rss": "_bytes", "rates": "_hertz", "reactions": "_seconds",
}  # fmt: skip
# By metric, the words of a fixed set: 0 or 1 for each of them.
WORDS = {
    "t2_link_state": get_args(LinkState),
    "t2_link_relay_state": get_args(LinkState),
    "t2_localization_state": get_args(MapState),
    "t2_patrol_state": get_args(RoundState),
    "t2_safety_verdict": get_args(Verdict),
}
# Sentences, ids and times that say nothing as a number; matrices; labels.
OMITTED = {
    *Message.__struct_fields__, "text", "waiting", "release_refusal", "heartbeat", "latched_by",
    "estop", "ports", "frame_id", "child_frame_id", "pose_covariance", "twist_covariance",
    "service", "limit_sources", "odom", "odom_boot", "odom_seq", "placement", "sources",
    "actions", "round", "route", "station", "teaching", "next",
}  # fmt: skip
# Metrics that are no fields of messages.
METRICS = {
    "t2_bus_connected": "Whether the exporter is connected to a router",
    "t2_robot_up": "Whether the robot is alive",
    "t2_service_up": "Whether the service is present and healthy",
    "t2_service_instances": "Processes of the service on the bus",
    "t2_localization_sigma_meters": "Greatest standard deviation of the position in the map",
    "t2_events_total": "Events received, including replayed ones, by `event` and `level`",
}


class Scrape:
    """The metric families of one scrape."""

    def __init__(self) -> None:
        self.families: dict[str, Metric] = {}

    def add(self, name: str, value: float, about: str = "", /, **labels: str) -> None:
        """Add a sample; a name that ends with ``_total`` is a counter's."""
        kind = CounterMetricFamily if name.endswith("_total") else GaugeMetricFamily
        made = kind(name, about or METRICS[name], labels=list(labels))
        family = self.families.setdefault(name, made)
        family.add_metric(list(labels.values()), float(value))  # type: ignore[attr-defined]

    def add_fields(self, prefix: str, part: Struct, **labels: str) -> None:
        """Add the fields of a message, also those of the structs inside."""
        about = f"Field of {type(part).__name__}, see docs/bus.md"
        for field in part.__struct_fields__:
            value = None if field in OMITTED else getattr(part, field)
            if isinstance(value, Struct):
                self.add_fields(f"{prefix}_{field}", value, **labels)
                continue
            name = f"{prefix}_{field}{UNITS.get(field, '')}"
            for word, number in _numbers(value, WORDS.get(name)):
                self.add(name, number, about, **labels, **word)


def _numbers(value: Any, words: Sequence[str] | None) -> Iterator[tuple[dict[str, str], float]]:
    """Yield the numbers of a value, with the label of their name if they have any."""
    if isinstance(value, bool | int | float):
        yield {}, value
    elif isinstance(value, str) and value:
        yield from (({"name": word}, word == value) for word in (words or (value,)))
    elif isinstance(value, dict):
        for name, number in sorted(value.items()):
            yield {"name": name}, number.worst if isinstance(number, Durations) else number
    elif isinstance(value, tuple):
        names = (one if isinstance(one, str) else one.name for one in value)
        yield from (({"name": name}, 1) for name in dict.fromkeys(names))


def metric_families(
    robots: Mapping[str, RobotState], now_ns: int, *, connected: bool
) -> list[Metric]:
    """Return every family, with the samples of all robots."""
    scrape = Scrape()
    scrape.add("t2_bus_connected", connected)
    for name, robot in sorted(robots.items()):
        _robot(scrape, name, robot, now_ns)
        for service in sorted(robot.instances):
            _service(scrape, name, robot, service, now_ns)
    return list(scrape.families.values())


def _robot(scrape: Scrape, name: str, robot: RobotState, now_ns: int) -> None:
    scrape.add("t2_robot_up", robot.is_up(now_ns), robot=name)
    for stream, topic in STREAMS.items():
        message = robot.fresh(topic.path, now_ns)
        if message is not None:
            scrape.add_fields(f"t2_{stream}", message, robot=name)
        if isinstance(message, MapPose) and message.pose_covariance:
            sigma = Covariance.of(message.pose_covariance).sigma
            scrape.add("t2_localization_sigma_meters", sigma, robot=name)
    for (service, event, level), count in sorted(robot.events.items()):
        labels = {"robot": name, "service": service, "event": event, "level": level}
        scrape.add("t2_events_total", count, **labels)


def _service(scrape: Scrape, name: str, robot: RobotState, service: str, now_ns: int) -> None:
    labels = {"robot": name, "service": service}
    scrape.add("t2_service_up", robot.is_healthy(service, now_ns), **labels)
    scrape.add("t2_service_instances", len(robot.instances[service]), **labels)
    health = robot.fresh(keys.HEALTH.path.format(service=service), now_ns)
    if health is not None:
        own = f"{keys.ROOT}/{name}/"
        rates = {key.removeprefix(own): rate for key, rate in health.rates.items()}
        scrape.add_fields("t2_service", replace(health, rates=rates), **labels)
