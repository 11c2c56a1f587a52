"""Messages and states of robots, and samples by name and labels."""

from typing import Any

from prometheus_client.core import Metric

from common.freshness import NS_PER_S
from services.metrics.robot import RobotState
from t2 import messages as m
from tests import factories
from tests.factories import health, odometry

NOW_NS = 1_000_000 * NS_PER_S  # any time but zero
SAFETY, LINK, ODOMETRY = "tel/safety/state", "tel/bridge/link", "tel/odom/odometry"
SERVICES = "bridge", "safety", "odom", "recorder"
MAP_POSE = "tel/localization/pose"
PATROL = "tel/patrol/state"
Values = dict[tuple[str, frozenset[tuple[str, str]]], float]


def link(**fields: Any) -> m.Link:
    return factories.link(epoch=2, rejected={"crc": 3}, **fields)


def safety(*latched: Any, **fields: Any) -> m.SafetyState:
    causes = tuple(m.Cause(name=name, action="brake", age=1.0, text=name) for name in latched)
    verdict = "brake" if latched else "run"
    return factories.safety_state(verdict=verdict, latched=latched, causes=causes, **fields)


def patrol(state: m.RoundState) -> m.PatrolState:
    return m.PatrolState(
        state=state, text="", round="1", route="yard", progress=3.0, deviation=0.2, sigma=0.1
    )


def event(name: Any) -> m.Event:
    return m.Event(name=name, level="error", text=name)


def whole() -> RobotState:
    """Return a robot whose messages have all arrived now."""
    robot = RobotState()
    for name in SERVICES:
        robot.on_live(name, "a", True, NOW_NS)
        robot.on_message(f"tel/{name}/health", health(name), NOW_NS)
    for path, message in {SAFETY: safety(), LINK: link(), ODOMETRY: odometry(angular=-0.2)}.items():
        robot.on_message(path, message, NOW_NS)
    return robot


def flat(families: list[Metric]) -> Values:
    """Return the value of each sample by name and labels."""
    return {
        (sample.name, frozenset(sample.labels.items())): sample.value
        for family in families
        for sample in family.samples
    }


def names(found: Values) -> set[str]:
    return {name for name, _ in found}
