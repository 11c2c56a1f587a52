"""What is told of what was heard: names, labels, and nothing that is old."""

from itertools import pairwise

import pytest

from common.freshness import NS_PER_S, Latest
from common.messages import Durations, Timing
from services.metrics.robot import WORTH_S, Robot
from services.metrics.samples import FAMILIES, sheet
from tests.metrics.robots import NOW_NS, event, health, link, odometry, safety, whole
from tests.metrics.values import Values, flat, names

LATE_NS = NOW_NS + round(WORTH_S * NS_PER_S) + 1
# What is told of a robot of which nothing is fresh.
ALWAYS = {
    "t2_robot_up", "t2_stream_age_seconds", "t2_service_up", "t2_service_instances",
    "t2_service_health_age_seconds", "t2_events_total",
}  # fmt: skip


def values(robot: Robot, now_ns: int = NOW_NS, *, connected: bool = True) -> Values:
    """Return every sample's value by its name and labels."""
    return flat(sheet({"007": robot}, now_ns, connected=connected, certificates={}))


def value(found: Values, name: str, **labels: str) -> float:
    return found[name, frozenset({"robot": "007", **labels}.items())]


def test_a_robot_that_fares_well() -> None:
    found = values(whole())
    assert found["t2_bus_connected", frozenset()] == 1
    assert value(found, "t2_robot_up") == 1
    assert value(found, "t2_service_up", service="bridge") == 1
    assert value(found, "t2_service_instances", service="bridge") == 1
    assert value(found, "t2_service_health_age_seconds", service="bridge") == 0
    assert value(found, "t2_service_info", service="bridge", version="0.1.0") == 1
    assert value(found, "t2_service_uptime_seconds", service="bridge") == 60
    assert value(found, "t2_service_resident_memory_bytes", service="bridge") == 50_000_000
    assert value(found, "t2_link_up") == 1
    assert value(found, "t2_link_armed") == 1
    assert value(found, "t2_link_round_trip_seconds") == 0.002
    assert value(found, "t2_link_frame_rate_hertz", frame="VelocityReport") == 50
    assert value(found, "t2_link_rejected_total", reason="crc") == 3
    assert value(found, "t2_link_board_restarts_total") == 2
    assert value(found, "t2_odometry_linear_velocity_meters_per_second") == 0.4
    assert value(found, "t2_odometry_angular_velocity_radians_per_second") == -0.2
    assert value(found, "t2_odometry_residual_meters") == 0.01
    assert value(found, "t2_odometry_slip") == 0
    assert value(found, "t2_safety_drives", source="teleop") == 1
    assert value(found, "t2_safety_latched") == 0
    assert value(found, "t2_recorder_disk_full") == 0


def test_the_verdict_in_force_is_one_and_the_others_are_none() -> None:
    robot = whole()
    robot.safety = Latest(safety("contact", "estop"), NOW_NS)
    found = values(robot)
    verdicts = {
        dict(labels)["verdict"]: count
        for (name, labels), count in found.items()
        if name == "t2_safety_verdict"
    }
    assert verdicts == {"run": 0, "slow": 0, "stop": 0, "brake": 1, "inhibited": 0}
    assert value(found, "t2_safety_latched") == 2
    assert value(found, "t2_safety_cause_active", cause="estop", action="brake") == 1


def test_nothing_old_is_told_of_a_robot_that_is_gone() -> None:
    robot = whole()
    robot.on_event("bridge", event("contact"))
    found = values(robot, LATE_NS)
    assert names(found) == ALWAYS | {"t2_bus_connected"}
    assert value(found, "t2_robot_up") == 0
    assert value(found, "t2_service_up", service="bridge") == 0
    for stream in ("safety", "link", "odometry"):
        assert value(found, "t2_stream_age_seconds", stream=stream) > WORTH_S
    assert value(found, "t2_service_health_age_seconds", service="bridge") > WORTH_S


def test_a_robot_that_was_never_heard_is_told_to_be_down() -> None:
    found = values(Robot(), connected=False)
    assert found["t2_bus_connected", frozenset()] == 0
    assert value(found, "t2_robot_up") == 0
    for service in ("bridge", "safety", "odom"):
        assert value(found, "t2_service_up", service=service) == 0
    assert names(found) == {
        "t2_bus_connected", "t2_robot_up", "t2_service_up", "t2_service_instances",
    }  # fmt: skip


def test_what_is_unknown_has_no_sample() -> None:
    robot = whole()
    robot.link = Latest(link(round_trip=None), NOW_NS)
    robot.odometry = Latest(odometry(residual=None), NOW_NS)
    robot.safety = Latest(safety(source=None), NOW_NS)
    found = names(values(robot))
    assert "t2_link_up" in found
    for name in ("t2_link_round_trip_seconds", "t2_odometry_residual_meters", "t2_safety_drives"):
        assert name not in found


def test_rates_and_counts_are_told_by_key_and_by_name() -> None:
    robot = whole()
    rates = {"t2/v1/007/tel/bridge/link": 5.0, "t2/v1/008/tel/bridge/link": 4.0}
    told = health(rates=rates, counters={"overrun": 2})
    robot.on_health("bridge", told, NOW_NS)
    found = values(robot)
    rate = value(found, "t2_service_message_rate_hertz", service="bridge", key="tel/bridge/link")
    assert rate == 5
    other = "t2/v1/008/tel/bridge/link"  # as who watches several robots has it
    assert value(found, "t2_service_message_rate_hertz", service="bridge", key=other) == 4
    assert value(found, "t2_service_counts_total", service="bridge", counter="overrun") == 2


def test_lateness_is_a_histogram_of_all_seconds() -> None:
    robot = Robot()
    for late_s in (0.001, 0.03, 0.3):
        robot.on_health("odom", health("odom", late_s=late_s), NOW_NS)
    found = values(robot)
    name = "t2_service_loop_lateness_seconds"
    assert value(found, f"{name}_bucket", service="odom", le="0.005") == 1
    assert value(found, f"{name}_bucket", service="odom", le="0.1") == 2
    assert value(found, f"{name}_bucket", service="odom", le="+Inf") == 3
    assert value(found, f"{name}_count", service="odom") == 3
    assert value(found, f"{name}_sum", service="odom") == pytest.approx(0.331)


def test_reactions_are_told_whole_and_thinned_without_losing_one() -> None:
    bounds = tuple(10e-6 * 10 ** (step / 8) for step in range(41))
    counts = tuple(range(42))
    timing = Timing(
        bounds=bounds,
        durations={
            "contact_to_break": Durations(counts=counts, worst=1.0),
            "contact_to_break.board_to_bridge": Durations(counts=counts, worst=1.0),
            "of another make": Durations(counts=(1, 2), worst=1.0),
        },
        not_counted={},
    )
    robot = whole()
    robot.on_health("bridge", health(timing=timing), NOW_NS)
    found = {
        dict(labels)["le"]: count
        for (name, labels), count in values(robot).items()
        if name == "t2_reaction_seconds_bucket" and dict(labels)["reaction"] == "contact_to_break"
    }
    assert len(found) == 12
    assert found["1e-05"] == 0
    assert found["0.0001"] == sum(counts[:9])
    assert found["1"] == sum(counts[:41])
    assert found["+Inf"] == sum(counts)
    ordered = [found[end] for end in sorted(found, key=float)]
    assert all(one <= other for one, other in pairwise(ordered))
    reactions = {
        dict(labels)["reaction"] for name, labels in values(robot) if name.startswith("t2_reaction")
    }
    assert reactions == {"contact_to_break"}


def test_a_full_disk_is_told_while_the_recorder_is_there() -> None:
    robot = whole()
    robot.on_event("recorder", event("disk_full", t_ns=1))
    assert value(values(robot), "t2_recorder_disk_full") == 1
    robot.on_live("recorder", "a", False, NOW_NS)
    assert "t2_recorder_disk_full" not in names(values(robot))
    del robot.services["recorder"]
    assert "t2_recorder_disk_full" not in names(values(robot))


def test_robots_stand_beside_each_other() -> None:
    both = {"b": whole(), "a": Robot()}
    found = flat(sheet(both, NOW_NS, connected=True, certificates={}))
    assert found["t2_robot_up", frozenset({("robot", "a")})] == 0
    assert found["t2_robot_up", frozenset({("robot", "b")})] == 1


def test_certificates_are_told_by_whose_they_are() -> None:
    found = flat(sheet({}, NOW_NS, connected=True, certificates={("driver", "anna"): 5.0}))
    labels = frozenset({("role", "driver"), ("name", "anna")})
    assert found["t2_certificate_expiry_timestamp_seconds", labels] == 5


def test_every_family_bears_a_name_by_the_conventions() -> None:
    assert len({family.name for family in FAMILIES}) == len(FAMILIES)
    for family in FAMILIES:
        assert family.name.startswith("t2_")
        assert family.name.endswith("_total") == (family.kind == "counter"), family.name
        assert family.what[0].isalnum()
