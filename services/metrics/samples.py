"""What was heard of the robots as Prometheus' samples: the table of families, and how they fill.

Pure. Names follow Prometheus' conventions: base units, ``_total`` for what only rises. What is not
fresh has no sample; ``t2_robot_up``, ``t2_service_up`` and the ages say so.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Literal, get_args

from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    Metric,
)

from common.freshness import Latest, fresh
from common.keys import ROOT
from common.messages import Health, Link, Odometry, SafetyState, Timing
from common.messages import Verdict as VerdictName
from services.metrics.robot import LATENESS_S, WORTH_S, Robot, Service

Kind = Literal["gauge", "counter", "histogram"]
KINDS = {"gauge": GaugeMetricFamily, "counter": CounterMetricFamily}
THINNED = 4  # every fourth bound of a reaction: half a decade each


@dataclass(frozen=True, slots=True)
class Family:
    """One metric: its samples differ in their labels."""

    name: str
    kind: Kind
    labels: tuple[str, ...]
    what: str


ONE = ("robot",)
EACH = ("robot", "service")
FAMILIES = (
    Family("t2_bus_connected", "gauge", (), "Whether the exporter has a router"),
    Family(
        "t2_certificate_expiry_timestamp_seconds",
        "gauge",
        ("role", "name"),
        "When a member's certificate ends",
    ),
    Family("t2_robot_up", "gauge", ONE, "Whether what runs on the robot is heard"),
    Family(
        "t2_stream_age_seconds", "gauge", (*ONE, "stream"), "Since a stream's last message came"
    ),
    Family("t2_service_up", "gauge", EACH, "Whether it is there and its loop turns"),
    Family("t2_service_instances", "gauge", EACH, "Processes of that service on the bus"),
    Family("t2_service_health_age_seconds", "gauge", EACH, "Since it last told how it fares"),
    Family("t2_service_info", "gauge", (*EACH, "version"), "Always 1; the version is the label"),
    Family("t2_service_uptime_seconds", "gauge", EACH, "Since it was started"),
    Family("t2_service_resident_memory_bytes", "gauge", EACH, "Memory that it holds"),
    Family("t2_service_realtime_priority", "gauge", EACH, "Of SCHED_FIFO; 0 if ordinary"),
    Family(
        "t2_service_message_rate_hertz", "gauge", (*EACH, "key"), "Messages in the last second"
    ),
    Family("t2_service_counts_total", "counter", (*EACH, "counter"), "What it counts, by name"),
    Family(
        "t2_service_loop_lateness_seconds",
        "histogram",
        EACH,
        "How late the latest timer was, of each second",
    ),
    Family(
        "t2_reaction_seconds", "histogram", (*EACH, "reaction"), "How long a reaction took"
    ),
    Family("t2_safety_verdict", "gauge", (*ONE, "verdict"), "1 for the verdict in force"),
    Family("t2_safety_latched", "gauge", ONE, "Causes that want a reset"),
    Family(
        "t2_safety_cause_active",
        "gauge",
        (*ONE, "cause", "action"),
        "1 for each reason why it may not move as asked",
    ),
    Family("t2_safety_drives", "gauge", (*ONE, "source"), "1 for who drives"),
    Family("t2_link_up", "gauge", ONE, "Whether the board is heard"),
    Family("t2_link_armed", "gauge", ONE, "Whether the bridge would obey a RUN"),
    Family("t2_link_round_trip_seconds", "gauge", ONE, "A query to the board, median"),
    Family("t2_link_frame_rate_hertz", "gauge", (*ONE, "frame"), "Frames in the last second"),
    Family(
        "t2_link_rejected_total", "counter", (*ONE, "reason"), "Frames and datagrams refused"
    ),
    Family("t2_link_board_restarts_total", "counter", ONE, "How often the board started anew"),
    Family("t2_odometry_linear_velocity_meters_per_second", "gauge", ONE, "Forward positive"),
    Family(
        "t2_odometry_angular_velocity_radians_per_second",
        "gauge",
        ONE,
        "Counter-clockwise positive",
    ),
    Family(
        "t2_odometry_residual_meters", "gauge", ONE, "Counters less velocities, a second's"
    ),
    Family("t2_odometry_slip", "gauge", ONE, "Whether counters and velocities disagree"),
    Family("t2_recorder_disk_full", "gauge", ONE, "Whether the recorder has stopped for room"),
    Family(
        "t2_events_total", "counter", (*EACH, "event", "level"), "Events heard, those kept too"
    ),
)  # fmt: skip


class Sheet:
    """The families of one scrape, as they fill."""

    def __init__(self) -> None:
        self.families: dict[str, Metric] = {}
        for each in FAMILIES:
            kind = KINDS.get(each.kind, HistogramMetricFamily)
            self.families[each.name] = kind(each.name, each.what, labels=each.labels)

    def put(self, name: str, value: float, *labels: str) -> None:
        """Add a gauge's or a counter's sample."""
        self.families[name].add_metric(labels, float(value))  # type: ignore[attr-defined]

    def tally(
        self,
        name: str,
        bounds: Sequence[float],
        counts: Iterable[int],
        total: float | None,
        *labels: str,
    ) -> None:
        """Add a histogram; ``counts`` are each bound's own, and one for what is over them all."""
        ends = [*(f"{bound:.3g}" for bound in bounds), "+Inf"]
        buckets = list(zip(ends, accumulate(counts), strict=True))
        self.families[name].add_metric(labels, buckets, total)  # type: ignore[attr-defined]


def sheet(
    robots: Mapping[str, Robot],
    now_ns: int,
    *,
    connected: bool,
    certificates: Mapping[tuple[str, str], float],
) -> list[Metric]:
    """Return every family, with the samples of all robots.

    ``certificates`` are their ends by role and name, in seconds since 1970.
    """
    made = Sheet()
    made.put("t2_bus_connected", connected)
    for who, end in sorted(certificates.items()):
        made.put("t2_certificate_expiry_timestamp_seconds", end, *who)
    for name, robot in sorted(robots.items()):
        _robot(made, name, robot, now_ns)
        for each, service in sorted(robot.services.items()):
            _service(made, (name, each), service, now_ns)
    return list(made.families.values())


def _robot(made: Sheet, name: str, robot: Robot, now_ns: int) -> None:
    made.put("t2_robot_up", robot.is_up(now_ns), name)
    streams: dict[str, Latest[SafetyState] | Latest[Link] | Latest[Odometry] | None] = {
        "safety": robot.safety,
        "link": robot.link,
        "odometry": robot.odometry,
    }
    for stream, latest in streams.items():
        if latest is not None:
            made.put("t2_stream_age_seconds", latest.age_s(now_ns), name, stream)
    if robot.safety and fresh(robot.safety, now_ns, WORTH_S):
        _safety(made, name, robot.safety.value)
    if robot.link and fresh(robot.link, now_ns, WORTH_S):
        _link(made, name, robot.link.value)
    if robot.odometry and fresh(robot.odometry, now_ns, WORTH_S):
        _odometry(made, name, robot.odometry.value)
    recorder = robot.services.get("recorder")
    if recorder and recorder.is_well(now_ns):
        made.put("t2_recorder_disk_full", robot.no_room(), name)
    for (service, event, level), count in sorted(robot.events.items()):
        made.put("t2_events_total", count, name, service, event, level)


def _service(made: Sheet, labels: tuple[str, str], service: Service, now_ns: int) -> None:
    made.put("t2_service_up", service.is_well(now_ns), *labels)
    made.put("t2_service_instances", len(service.instances), *labels)
    if service.health is None:
        return
    made.put("t2_service_health_age_seconds", service.health.age_s(now_ns), *labels)
    if fresh(service.health, now_ns, WORTH_S):
        _health(made, labels, service.health.value)
        tally = service.lateness
        made.tally(
            "t2_service_loop_lateness_seconds", LATENESS_S, tally.counts, tally.total, *labels
        )


def _health(made: Sheet, labels: tuple[str, str], health: Health) -> None:
    made.put("t2_service_info", 1, *labels, health.version)
    made.put("t2_service_uptime_seconds", health.uptime, *labels)
    made.put("t2_service_resident_memory_bytes", health.rss, *labels)
    made.put("t2_service_realtime_priority", health.priority, *labels)
    for key, rate in sorted(health.rates.items()):
        short = key.removeprefix(f"{ROOT}/{labels[0]}/")  # stands in the labels already
        made.put("t2_service_message_rate_hertz", rate, *labels, short)
    for counter, count in sorted(health.counters.items()):
        made.put("t2_service_counts_total", count, *labels, counter)
    if health.timing is not None:
        _timing(made, labels, health.timing)


def _timing(made: Sheet, labels: tuple[str, str], timing: Timing) -> None:
    """Tell the whole reactions; their hops are for `t2 latency`."""
    for name, durations in sorted(timing.durations.items()):
        fits = len(durations.counts) == len(timing.bounds) + 1
        if "." in name or not fits:
            continue
        up_to = list(accumulate(durations.counts))
        kept = [*up_to[:-1:THINNED], up_to[-1]]
        counts = [after - before for before, after in zip([0, *kept], kept, strict=False)]
        made.tally("t2_reaction_seconds", timing.bounds[::THINNED], counts, None, *labels, name)


def _safety(made: Sheet, robot: str, state: SafetyState) -> None:
    for verdict in get_args(VerdictName):
        made.put("t2_safety_verdict", verdict == state.verdict, robot, verdict)
    made.put("t2_safety_latched", len(state.latched), robot)
    for cause in state.causes:
        made.put("t2_safety_cause_active", 1, robot, cause.name, cause.action)
    if state.source is not None:
        made.put("t2_safety_drives", 1, robot, state.source)


def _link(made: Sheet, robot: str, link: Link) -> None:
    made.put("t2_link_up", link.state == "up", robot)
    made.put("t2_link_armed", link.armed, robot)
    made.put("t2_link_board_restarts_total", link.epoch, robot)
    if link.round_trip is not None:
        made.put("t2_link_round_trip_seconds", link.round_trip, robot)
    for frame, rate in sorted(link.rates.items()):
        made.put("t2_link_frame_rate_hertz", rate, robot, frame)
    for reason, count in sorted(link.rejected.items()):
        made.put("t2_link_rejected_total", count, robot, reason)


def _odometry(made: Sheet, robot: str, odometry: Odometry) -> None:
    made.put("t2_odometry_linear_velocity_meters_per_second", odometry.linear, robot)
    made.put("t2_odometry_angular_velocity_radians_per_second", odometry.angular, robot)
    made.put("t2_odometry_slip", odometry.slip, robot)
    if odometry.residual is not None:
        made.put("t2_odometry_residual_meters", odometry.residual, robot)
