"""Prometheus samples of the robots, by the table of metric families ``families.toml``.

Names follow Prometheus' conventions: base units, ``_total`` for counters. Stale values have no
sample; ``t2_robot_up``, ``t2_service_up`` and the ages report them.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import accumulate
from pathlib import Path
from typing import Any, Literal, get_args

import msgspec
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    Metric,
)

from common.freshness import fresh
from common.keys import ROOT
from common.members import Members
from common.messages import Health, Link, Message, Odometry, SafetyState, Verdict
from services.metrics.robot import FRESH_S, LATENESS_S, RobotState, ServiceState

FILE = Path(__file__).with_name("families.toml")
Kind = Literal["gauge", "counter", "histogram"]
KINDS = {"gauge": GaugeMetricFamily, "counter": CounterMetricFamily}


class Family(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A metric; its samples differ in their labels."""

    name: str
    kind: Kind
    labels: tuple[str, ...]
    help: str


FAMILIES = msgspec.toml.decode(FILE.read_bytes(), type=dict[str, tuple[Family, ...]])["family"]


class Scrape:
    """The metric families of one scrape."""

    def __init__(self) -> None:
        self.families: dict[str, Metric] = {}
        for each in FAMILIES:
            kind = KINDS.get(each.kind, HistogramMetricFamily)
            self.families[each.name] = kind(each.name, each.help, labels=each.labels)

    def add(self, name: str, value: float, *labels: str) -> None:
        """Add a sample of a gauge or counter."""
        self.families[name].add_metric(labels, float(value))  # type: ignore[attr-defined]

    def add_histogram(
        self,
        name: str,
        bounds: Sequence[float],
        cumulative: Iterable[int],
        total: float | None,
        *labels: str,
    ) -> None:
        """Add a histogram by the counts up to each bound and the count of all."""
        ends = [*(f"{bound:.3g}" for bound in bounds), "+Inf"]
        buckets = list(zip(ends, cumulative, strict=True))
        self.families[name].add_metric(labels, buckets, total)  # type: ignore[attr-defined]


def metric_families(
    robots: Mapping[str, RobotState],
    now_ns: int,
    *,
    connected: bool,
    certificates: Mapping[tuple[str, str], float],
) -> list[Metric]:
    """Return every family, with the samples of all robots.

    ``certificates`` holds their expiry by role and name, in seconds since 1970.
    """
    scrape = Scrape()
    scrape.add("t2_bus_connected", connected)
    for member, expiry in sorted(certificates.items()):
        scrape.add("t2_certificate_expiry_timestamp_seconds", expiry, *member)
    for name, robot in sorted(robots.items()):
        _robot(scrape, name, robot, now_ns)
        for each, service in sorted(robot.services.items()):
            _service(scrape, (name, each), service, now_ns)
    return list(scrape.families.values())


def _robot(scrape: Scrape, name: str, robot: RobotState, now_ns: int) -> None:
    scrape.add("t2_robot_up", robot.is_up(now_ns), name)
    for message, latest in robot.streams.items():
        stream, add_samples = OF_STREAM[message]
        scrape.add("t2_stream_age_seconds", latest.age_s(now_ns), name, stream)
        if fresh(latest, now_ns, FRESH_S):
            add_samples(scrape, name, latest.value)
    recorder = robot.services.get("recorder")
    if recorder and recorder.is_healthy(now_ns):
        scrape.add("t2_recorder_disk_full", robot.disk_full(), name)
    for (service, event, level), count in sorted(robot.events.items()):
        scrape.add("t2_events_total", count, name, service, event, level)


def _service(scrape: Scrape, labels: tuple[str, str], service: ServiceState, now_ns: int) -> None:
    scrape.add("t2_service_up", service.is_healthy(now_ns), *labels)
    scrape.add("t2_service_instances", len(service.instances), *labels)
    if service.health is None:
        return
    scrape.add("t2_service_health_age_seconds", service.health.age_s(now_ns), *labels)
    if fresh(service.health, now_ns, FRESH_S):
        _health(scrape, labels, service.health.value)
        late, counts = service.lateness, accumulate(service.lateness.counts)
        scrape.add_histogram(
            "t2_service_loop_lateness_seconds", LATENESS_S, counts, late.total, *labels
        )


def _health(scrape: Scrape, labels: tuple[str, str], health: Health) -> None:
    scrape.add("t2_service_info", 1, *labels, health.version)
    scrape.add("t2_service_uptime_seconds", health.uptime, *labels)
    scrape.add("t2_service_resident_memory_bytes", health.rss, *labels)
    scrape.add("t2_service_realtime_priority", health.priority, *labels)
    for key, rate in sorted(health.rates.items()):
        short = key.removeprefix(f"{ROOT}/{labels[0]}/")  # is already in the labels
        scrape.add("t2_service_message_rate_hertz", rate, *labels, short)
    for counter, count in sorted(health.counters.items()):
        scrape.add("t2_service_counts_total", count, *labels, counter)
    for name, each in sorted(health.reactions.items()):
        if len(each.counts) == len(each.bounds) + 1:
            scrape.add_histogram(
                "t2_reaction_seconds", each.bounds, accumulate(each.counts), None, *labels, name
            )


def _safety(scrape: Scrape, robot: str, state: SafetyState) -> None:
    for verdict in get_args(Verdict):
        scrape.add("t2_safety_verdict", verdict == state.verdict, robot, verdict)
    scrape.add("t2_safety_latched", len(state.latched), robot)
    for cause in state.causes:
        scrape.add("t2_safety_cause_active", 1, robot, cause.name, cause.action)
    if state.source is not None:
        scrape.add("t2_safety_drives", 1, robot, state.source)


def _link(scrape: Scrape, robot: str, link: Link) -> None:
    scrape.add("t2_link_up", link.state == "up", robot)
    scrape.add("t2_link_armed", link.armed, robot)
    scrape.add("t2_link_board_restarts_total", link.epoch, robot)
    if link.round_trip is not None:
        scrape.add("t2_link_round_trip_seconds", link.round_trip, robot)
    for frame, rate in sorted(link.rates.items()):
        scrape.add("t2_link_frame_rate_hertz", rate, robot, frame)
    for reason, count in sorted(link.rejected.items()):
        scrape.add("t2_link_rejected_total", count, robot, reason)


def _odometry(scrape: Scrape, robot: str, odometry: Odometry) -> None:
    scrape.add("t2_odometry_linear_velocity_meters_per_second", odometry.linear, robot)
    scrape.add("t2_odometry_angular_velocity_radians_per_second", odometry.angular, robot)
    scrape.add("t2_odometry_slip", odometry.slip, robot)
    if odometry.residual is not None:
        scrape.add("t2_odometry_residual_meters", odometry.residual, robot)


OF_STREAM: dict[type[Message], tuple[str, Callable[[Scrape, str, Any], None]]] = {
    SafetyState: ("safety", _safety), Link: ("link", _link), Odometry: ("odometry", _odometry),
}  # fmt: skip


def certificate_expiry(listed: Members) -> dict[tuple[str, str], float]:
    """Return the expiry of the certificates by role and name, in seconds since 1970.

    A renewed member is listed more than once until its old certificate expires: the latest counts.
    """
    found: dict[tuple[str, str], float] = {}
    for one in listed.welcome:
        member, expiry = (one.role, one.name), one.expires.timestamp()
        found[member] = max(expiry, found.get(member, expiry))
    return found
