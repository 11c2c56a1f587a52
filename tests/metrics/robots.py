"""Messages and states of robots."""

from common import messages as m
from common.freshness import NS_PER_S, Latest
from services.metrics.robot import RobotState

NOW_NS = 1_000_000 * NS_PER_S  # any time but zero


def health(
    service: str = "bridge", *, boot: int = 1, late_s: float = 0.0, **more: object
) -> m.Health:
    given: dict[str, object] = {
        "version": "0.1.0", "uptime": 60.0, "rates": {}, "counters": {}, "rss": 50_000_000,
    } | more  # fmt: skip
    return m.Health(service=service, boot=boot, lateness=late_s, **given)  # type: ignore[arg-type]


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


def event(name: str, *, t_ns: int = 0, boot: int = 1, level: m.Level = "error") -> m.Event:
    return m.Event(name=name, level=level, text=name, t_ns=t_ns, boot=boot)


def whole(at_ns: int = NOW_NS) -> RobotState:
    """Return a robot whose messages all arrived at that time."""
    robot = RobotState()
    for name in ("bridge", "safety", "odom", "recorder"):
        robot.on_live(name, "a", True, at_ns)
        robot.on_health(name, health(name), at_ns)
    robot.streams[m.SafetyState] = Latest(safety(), at_ns)
    robot.streams[m.Link] = Latest(link(), at_ns)
    robot.streams[m.Odometry] = Latest(odometry(), at_ns)
    return robot
