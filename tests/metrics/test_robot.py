"""What was heard of one robot: when it is fresh, when it is gone, when it is forgotten."""

import math

import pytest

from common.freshness import NS_PER_S, Latest
from services.metrics.robot import EXPECTED, KEPT_S, NAMES, WORTH_S, Robot, Tally, prune
from tests.metrics.robots import NOW_NS, event, health, link, whole

LATE_NS = NOW_NS + round(WORTH_S * NS_PER_S) + 1
LONG_NS = NOW_NS + round(KEPT_S * NS_PER_S) + 1


def test_a_robot_of_which_nothing_was_heard_is_not_up() -> None:
    robot = Robot()
    assert not robot.is_up(NOW_NS)
    assert set(robot.services) == set(EXPECTED)
    assert not any(service.is_well(NOW_NS) for service in robot.services.values())


def test_it_is_up_as_long_as_anything_is_fresh() -> None:
    robot = whole()
    assert robot.is_up(NOW_NS)
    assert not robot.is_up(LATE_NS)
    robot.link = Latest(link(), LATE_NS)
    assert robot.is_up(LATE_NS)


def test_a_service_is_well_by_its_token_and_its_health() -> None:
    robot = Robot()
    robot.on_health("bridge", health(), NOW_NS)
    bridge = robot.services["bridge"]
    assert not bridge.is_well(NOW_NS)  # it fares well, and no token stands
    robot.on_live("bridge", "a", True, NOW_NS)
    assert bridge.is_well(NOW_NS)
    assert robot.is_up(NOW_NS)
    assert not bridge.is_well(LATE_NS)  # it hangs
    robot.on_live("bridge", "b", True, LATE_NS)
    robot.on_live("bridge", "a", False, LATE_NS)
    assert bridge.instances == {"b"}
    robot.on_live("bridge", "b", False, LATE_NS)
    robot.on_live("bridge", "never there", False, LATE_NS)
    assert not bridge.instances


def test_what_runs_on_a_laptop_under_its_id_is_not_the_robot() -> None:
    robot = Robot()
    robot.on_live("metrics", "a", True, NOW_NS)
    robot.on_health("metrics", health("metrics"), NOW_NS)
    assert robot.services["metrics"].is_well(NOW_NS)
    assert not robot.is_up(NOW_NS)


def test_lateness_is_counted_by_size_and_no_number_is_not() -> None:
    tally = Tally()
    for late_s in (0.0, 0.005, 0.006, 0.3, 7.0, math.nan, math.inf):
        tally.add(late_s)
    assert tally.counts == [2, 1, 0, 0, 0, 0, 1, 0, 1]
    assert tally.total == pytest.approx(7.311)


def test_the_disk_is_full_by_the_last_word_of_the_recorder_that_runs() -> None:
    robot = Robot()
    assert not robot.no_room()
    robot.on_event("recorder", event("disk_full", t_ns=10, boot=7))
    assert not robot.no_room()  # no recorder was heard yet
    robot.on_health("recorder", health("recorder", boot=7), NOW_NS)
    assert robot.no_room()
    robot.on_event("recorder", event("disk_room", t_ns=5, boot=7))  # a late one
    robot.on_event("recorder", event("black_box_lost", t_ns=20, boot=7))
    robot.on_event("bridge", event("disk_room", t_ns=20, boot=7))
    assert robot.no_room()
    robot.on_health("recorder", health("recorder", boot=8), NOW_NS)
    assert not robot.no_room()  # another recorder: it tells by itself
    robot.on_event("recorder", event("disk_full", t_ns=30, boot=8))
    assert robot.no_room()
    robot.on_event("recorder", event("disk_room", t_ns=31, boot=8))
    assert not robot.no_room()


def test_a_recorder_without_an_event_has_room() -> None:
    assert not whole().no_room()


def test_events_are_counted_by_name() -> None:
    robot = Robot()
    for _ in range(2):
        robot.on_event("bridge", event("contact"))
    robot.on_event("safety", event("contact"))
    assert robot.events == {
        ("bridge", "contact", "error"): 2,
        ("safety", "contact", "error"): 1,
    }


def test_invented_events_do_not_fill_the_memory() -> None:
    robot = Robot()
    for number in range(NAMES + 7):
        robot.on_event("dashboard", event(f"e{number}"))
    assert robot.events["dashboard", "other", "error"] == 7
    assert len(robot.events) == NAMES + 1


def test_it_is_a_robot_once_what_runs_on_one_was_heard() -> None:
    robot = Robot()
    robot.on_health("dashboard", health("dashboard"), NOW_NS)
    assert not robot.is_robot
    assert Robot(link=Latest(link(), NOW_NS)).is_robot


def test_a_service_that_is_long_gone_is_forgotten_and_an_expected_one_is_not() -> None:
    robot = whole()
    for name in ("bridge", "recorder"):
        robot.on_live(name, "a", False, NOW_NS)
    assert not robot.forget(LONG_NS - 1)
    assert "recorder" in robot.services
    assert not robot.forget(LONG_NS)  # others are there
    assert "recorder" not in robot.services
    assert "bridge" in robot.services


@pytest.mark.parametrize("name", ["bridge", "safety", "odom", "recorder"])
def test_a_robot_is_forgotten_when_none_of_it_is_left(name: str) -> None:
    robot = whole()
    for each in list(robot.services):
        robot.on_live(each, "a", False, NOW_NS)
    robot.on_live(name, "a", True, NOW_NS)
    assert not robot.forget(LONG_NS)  # it hangs, and is there
    robot.on_live(name, "a", False, LONG_NS)
    assert not robot.forget(LONG_NS + 1)
    assert robot.forget(LONG_NS + round(KEPT_S * NS_PER_S) + 1)


def test_a_robot_whose_streams_alone_are_heard_is_kept() -> None:
    robot = Robot()
    robot.link = Latest(link(), NOW_NS)
    assert not robot.forget(LONG_NS - 1)
    assert robot.forget(LONG_NS)


def test_of_ones_own_robot_services_are_forgotten_and_the_robot_is_not() -> None:
    robots = {"007": whole(), "008": whole(), "laptop": Robot()}
    for name in ("007", "008"):
        for service in list(robots[name].services):
            robots[name].on_live(service, "a", False, NOW_NS)
    prune(robots, "007", LONG_NS - 1)
    assert set(robots) == {"007", "008"}
    prune(robots, "007", LONG_NS)
    assert set(robots) == {"007"}
    assert set(robots["007"].services) == set(EXPECTED)
