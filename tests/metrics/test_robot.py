"""State of one robot: freshness, presence, expiry."""

import pytest

from common import messages as m
from common.freshness import NS_PER_S, Latest
from services.metrics.robot import (
    EVENT_NAMES_MAX,
    EXPIRY_S,
    FRESH_S,
    RobotState,
    prune,
)
from tests.metrics.robots import NOW_NS, event, health, link, whole

LATE_NS = NOW_NS + round(FRESH_S * NS_PER_S) + 1
LONG_NS = NOW_NS + round(EXPIRY_S * NS_PER_S) + 1


def test_a_robot_is_up_while_any_stream_is_fresh() -> None:
    robot = whole()
    assert robot.is_up(NOW_NS)
    assert not robot.is_up(LATE_NS)
    robot.streams[m.Link] = Latest(link(), LATE_NS)
    assert robot.is_up(LATE_NS)


def test_a_service_is_healthy_with_token_and_fresh_health() -> None:
    robot = RobotState()
    robot.on_health("bridge", health(), NOW_NS)
    bridge = robot.services["bridge"]
    assert not bridge.is_healthy(NOW_NS)  # healthy, but without a token
    robot.on_live("bridge", "a", True, NOW_NS)
    assert bridge.is_healthy(NOW_NS)
    assert robot.is_up(NOW_NS)
    assert not bridge.is_healthy(LATE_NS)  # it hangs
    robot.on_live("bridge", "b", True, LATE_NS)
    robot.on_live("bridge", "a", False, LATE_NS)
    assert bridge.instances == {"b"}
    robot.on_live("bridge", "b", False, LATE_NS)
    robot.on_live("bridge", "never there", False, LATE_NS)
    assert not bridge.instances


def test_a_service_on_a_laptop_is_not_the_robot() -> None:
    robot = RobotState()
    robot.on_live("metrics", "a", True, NOW_NS)
    robot.on_health("metrics", health("metrics"), NOW_NS)
    assert robot.services["metrics"].is_healthy(NOW_NS)
    assert not robot.is_up(NOW_NS)


def test_disk_full_follows_the_latest_event_of_the_running_recorder() -> None:
    robot = RobotState()
    assert not robot.disk_full()
    robot.on_event("recorder", event("disk_full", t_ns=10, boot=7))
    assert not robot.disk_full()  # no recorder seen yet
    robot.on_health("recorder", health("recorder", boot=7), NOW_NS)
    assert robot.disk_full()
    robot.on_event("recorder", event("disk_room", t_ns=5, boot=7))  # delayed
    robot.on_event("recorder", event("black_box_lost", t_ns=20, boot=7))
    robot.on_event("bridge", event("disk_room", t_ns=20, boot=7))
    assert robot.disk_full()
    robot.on_health("recorder", health("recorder", boot=8), NOW_NS)
    assert not robot.disk_full()  # another process of the recorder
    robot.on_event("recorder", event("disk_full", t_ns=30, boot=8))
    assert robot.disk_full()
    robot.on_event("recorder", event("disk_room", t_ns=31, boot=8))
    assert not robot.disk_full()


def test_events_are_counted_by_name_and_the_names_are_bounded() -> None:
    robot = RobotState()
    for service, name in (("bridge", "contact"), ("bridge", "contact"), ("safety", "contact")):
        robot.on_event(service, event(name))
    assert robot.events["bridge", "contact", "error"] == 2
    assert robot.events["safety", "contact", "error"] == 1
    for number in range(EVENT_NAMES_MAX + 5):
        robot.on_event("dashboard", event(f"e{number}"))
    assert robot.events["dashboard", "other", "error"] == 7
    assert len(robot.events) == EVENT_NAMES_MAX + 1


def test_a_stream_of_a_robot_makes_and_keeps_a_robot() -> None:
    robot = RobotState()
    robot.on_health("dashboard", health("dashboard"), NOW_NS)
    assert not robot.is_robot
    robot = RobotState(streams={m.Link: Latest(link(), NOW_NS)})
    assert robot.is_robot
    assert not robot.is_expired(LONG_NS - 1)
    assert robot.is_expired(LONG_NS)


@pytest.mark.parametrize("name", ["bridge", "safety", "odom", "recorder"])
def test_a_robot_expires_when_all_its_services_are_gone(name: str) -> None:
    robot = whole()
    for each in list(robot.services):
        robot.on_live(each, "a", False, NOW_NS)
    robot.on_live(name, "a", True, NOW_NS)
    assert not robot.is_expired(LONG_NS)  # it hangs, but is present
    robot.on_live(name, "a", False, LONG_NS)
    assert not robot.is_expired(LONG_NS + 1)
    assert robot.is_expired(LONG_NS + round(EXPIRY_S * NS_PER_S) + 1)


def test_the_own_robot_never_expires() -> None:
    robots = {"007": whole(), "008": whole(), "laptop": RobotState()}
    for name in ("007", "008"):
        for service in list(robots[name].services):
            robots[name].on_live(service, "a", False, NOW_NS)
    prune(robots, "007", LONG_NS - 1)
    assert set(robots) == {"007", "008"}
    prune(robots, "007", LONG_NS)
    assert set(robots) == {"007"}
