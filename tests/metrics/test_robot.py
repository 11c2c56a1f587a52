"""State of one robot: freshness, presence, expiry."""

import pytest

from common.config import Sources, load
from common.errors import ConfigError
from common.freshness import NS_PER_S
from services.metrics.config import MetricsConfig
from services.metrics.robot import EVENT_NAMES_MAX, EXPIRY_S, FRESH_S, RobotState, prune
from tests.factories import health
from tests.metrics.robots import LINK, NOW_NS, event, link, whole

LATE_NS = NOW_NS + round(FRESH_S * NS_PER_S) + 1
LONG_NS = NOW_NS + round(EXPIRY_S * NS_PER_S) + 1


def test_a_robot_is_up_while_any_message_of_its_own_services_is_fresh() -> None:
    robot = whole()
    assert robot.is_up(NOW_NS)
    assert not robot.is_up(LATE_NS)
    robot.on_message(LINK, link(), LATE_NS)
    assert robot.is_up(LATE_NS)
    laptop = RobotState()
    laptop.on_message("tel/metrics/health", health("metrics"), NOW_NS)
    assert not laptop.is_up(NOW_NS)


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


def test_the_own_robot_never_expires_and_a_laptop_is_none() -> None:
    laptop = RobotState()
    laptop.on_message("tel/dashboard/health", health("dashboard"), NOW_NS)
    robots = {"007": whole(), "008": whole(), "laptop": laptop}
    prune(robots, "007", LONG_NS - 1)
    assert set(robots) == {"007", "008"}
    prune(robots, "007", LONG_NS)
    assert set(robots) == {"007"}


@pytest.mark.parametrize(
    ("robots", "is_valid"),
    [
        *((each, True) for each in ("", "*", "001", "berlin-$*", "$*-007", "a$*b")),
        *((each, False) for each in ("**", "$*", "a*", "a/b", "$*$*", "a b", "@x", "a$")),
    ],
)
def test_robots_is_an_id_or_one_chunk_of_a_key_expression(robots: str, is_valid: bool) -> None:
    sources = Sources(environ={}, sets=[f"metrics.robots={robots}"])
    if is_valid:
        assert load(MetricsConfig, sources).config.metrics.robots == robots
    else:
        with pytest.raises(ConfigError, match=r"metrics\.robots"):
            load(MetricsConfig, sources)
