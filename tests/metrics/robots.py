"""Messages and states of robots, and samples by name and labels."""

from prometheus_client.core import Metric

from common import messages as m
from common.freshness import NS_PER_S
from services.metrics.robot import RobotState

NOW_NS = 1_000_000 * NS_PER_S  # any time but zero
SAFETY, LINK, ODOMETRY = "tel/safety/state", "tel/bridge/link", "tel/odom/odometry"
SERVICES = "bridge", "safety", "odom", "recorder"
Values = dict[tuple[str, frozenset[tuple[str, str]]], float]


def health(service: str = "bridge", **more: object) -> m.Health:
    given: dict[str, object] = {
        "version": "0.1.0", "uptime": 60.0, "rates": {}, "counters": {}, "rss": 50_000_000,
        "lateness": 0.0,
    } | more  # fmt: skip
    return m.Health(service=service, **given)  # type: ignore[arg-type]


def link(state: m.LinkState = "up", round_trip: float | None = 0.002) -> m.Link:
    return m.Link(
        state=state, board="127.0.0.1:4003", epoch=2, armed=state == "up", waiting="",
        rates={"VelocityReport": 50.0}, rejected={"crc": 3}, round_trip=round_trip,
    )  # fmt: skip


def odometry(residual: float | None = 0.01) -> m.Odometry:
    return m.Odometry(
        x=1.0, y=2.0, heading=0.5, linear=0.4, angular=-0.2, pose_covariance=(0.0,) * 9,
        twist_covariance=(0.0,) * 4, epoch=0, residual=residual, slip=False,
    )  # fmt: skip


def safety(*latched: str, source: str | None = "teleop") -> m.SafetyState:
    causes = tuple(m.Cause(name=name, action="brake", age=1.0, text=name) for name in latched)
    return m.SafetyState(
        verdict="brake" if latched else "run", latched=latched, causes=causes, source=source,
        limits=m.Limits(forward=1.0, backward=1.0, angular=1.0), heartbeat=1, text="",
    )  # fmt: skip


def event(name: str) -> m.Event:
    return m.Event(name=name, level="error", text=name)


def whole(at_ns: int = NOW_NS) -> RobotState:
    """Return a robot whose messages all arrived at that time."""
    robot = RobotState()
    for name in SERVICES:
        robot.on_live(name, "a", True, at_ns)
        robot.on_message(f"tel/{name}/health", health(name), at_ns)
    for path, message in {SAFETY: safety(), LINK: link(), ODOMETRY: odometry()}.items():
        robot.on_message(path, message, at_ns)
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
