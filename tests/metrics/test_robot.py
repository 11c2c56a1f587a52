"""State of one robot: freshness, presence, expiry."""

import pytest

from common.config import Sources, load
from common.errors import ConfigError
from common.freshness import NS_PER_S
from services.metrics.config import MetricsConfig
from services.metrics.robot import EVENT_NAMES_MAX, EXPIRY_S, FRESH_S, RobotState, prune
from tests.factories import health
from tests.metrics.robots import LINK, NOW_NS, SERVICES, event, link, whole

LATE_NS = NOW_NS + round(FRESH_S * NS_PER_S) + 1
LONG_NS = NOW_NS + round(EXPIRY_S * NS_PER_S) + 1


def test_a_robot_is_up_while_any_message_of_its_own_services_is_fresh() -> None:
    robot = whole()
    assert robot.is_up(NOW_NS)
    assert not robot.is_up(LATE_NS)
    robot.on_message(LINK, link(), LATE_NS)
    assert robot.is_up(LATE_NS)
    laptop = RobotState()
    laptop.on_live("metrics", "a", True, NOW_NS)
    laptop.on_message("tel/metrics/health", health("metrics"), NOW_NS)
    assert laptop.is_healthy("metrics", NOW_NS)
    assert not laptop.is_up(NOW_NS)


def test_a_service_is_healthy_with_token_and_fresh_health() -> None:
    robot = RobotState()
    robot.on_message("tel/bridge/health", health(), NOW_NS)
    assert not robot.is_healthy("bridge", NOW_NS)  # without a token
    robot.on_live("bridge", "a", True, NOW_NS)
    assert robot.is_healthy("bridge", NOW_NS)
    assert not robot.is_healthy("bridge", LATE_NS)  # it hangs
    robot.on_live("bridge", "b", True, LATE_NS)
    robot.on_live("bridge", "a", False, LATE_NS)
    robot.on_live("bridge", "never there", False, LATE_NS)
    assert robot.instances["bridge"] == {"b"}


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


def test_a_robot_expires_without_any_service_and_a_laptop_is_none() -> None:
    laptop = RobotState()
    laptop.on_message("tel/dashboard/health", health("dashboard"), NOW_NS)
    robots = {"own": whole(), "gone": whole(), "hangs": whole(), "laptop": laptop}
    for name, present in (("own", None), ("gone", None), ("hangs", "recorder")):
        for service in SERVICES:
            robots[name].on_live(service, "a", service == present, NOW_NS)
    prune(robots, "own", LONG_NS - 1)
    assert set(robots) == {"own", "gone", "hangs"}
    prune(robots, "own", LONG_NS)
    assert set(robots) == {"own", "hangs"}


@pytest.mark.parametrize(
    ("robots", "is_valid"),
    [
        *((each, True) for each in ("", "*", "berlin-$*", "$*-007", "a$*b")),
        *((each, False) for each in ("**", "$*", "a*", "a/b", "$*$*")),
    ],
)
def test_robots_is_an_id_or_one_chunk_of_a_key_expression(robots: str, is_valid: bool) -> None:
    sources = Sources(environ={}, sets=[f"metrics.robots={robots}"])
    if is_valid:
        assert load(MetricsConfig, sources).config.metrics.robots == robots
    else:
        with pytest.raises(ConfigError, match=r"metrics\.robots"):
            load(MetricsConfig, sources)
