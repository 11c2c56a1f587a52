"""A recorded drive of ten seconds with one contact and one reset."""

from collections.abc import Iterator

from common import messages as m
from common.freshness import NS_PER_S
from common.keys import ROOT
from common.motion import Command

BEGIN_NS = 1_700_000_000 * NS_PER_S
HIT_S, RESET_S, END_S = 4.0, 7.0, 10.0
CONTACT = m.Cause(name="contact", action="brake", age=0.0, text="The bumper was hit.")
IDLE = m.Cause(name="no_request", action="stop", age=0.0, text="No source requests motion.")

Arrival = tuple[str, str, m.Message, int]  # key, type, message, arrival time in ns


def drive() -> Iterator[Arrival]:
    """Yield all messages in the order of their arrival."""
    for number in range(round(END_S * 20)):
        at_s = number / 20
        held = HIT_S <= at_s < RESET_S
        for path, message in (
            ("@cmd/drive/teleop", m.Drive(seq=number, boot=1, linear=0.5, angular=0.1, echo=1)),
            ("tel/safety/state", state(held, number)),
            ("@cmd/motion", motion(held, number)),
            ("tel/bridge/velocity", m.Velocity(seq=number, boot=2, linear=0.4, angular=0.1)),
            ("tel/bridge/ultrasonic", ultrasonic(number)),
            ("tel/odom/odometry", odometry(number)),
        ):
            yield at(path, message, at_s)
        if at_s == HIT_S:
            yield at("evt/safety", event("latched", "error", "The <b>bumper</b> was hit."), at_s)
        if number % 20 == 0:
            yield at("tel/bridge/health", health(number // 20), at_s)


def at(path: str, message: m.Message, at_s: float) -> Arrival:
    """Return a message with its arrival time, in seconds since the start."""
    return f"{ROOT}/001/{path}", type(message).__name__, message, BEGIN_NS + round(at_s * NS_PER_S)


def state(held: bool, number: int = 0) -> m.SafetyState:
    """Return a safety state: braked by a latched contact, or driving."""
    return m.SafetyState(
        seq=number, boot=3, verdict="brake" if held else "run",
        latched=("contact",) if held else (), causes=(CONTACT,) if held else (), source="teleop",
        limits=m.Limits(forward=0.8, backward=0.5, angular=0.9), heartbeat=number, text="",
    )  # fmt: skip


def motion(held: bool, number: int) -> m.Motion:
    """Return safety's motion command."""
    if held:
        return m.Motion(seq=number, boot=3, command=Command.BRAKE, latched=True)
    return m.Motion(seq=number, boot=3, command=Command.RUN, linear=0.5, angular=0.1)


def ultrasonic(number: int) -> m.Ultrasonic:
    """Return eight ranges, one of them without an echo."""
    ranges = (1.0, None, *(2.0 + number / 100 for _ in range(6)))
    status: m.Statuses = ("ok", "no_echo", "ok", "ok", "ok", "ok", "ok", "ok")
    return m.Ultrasonic(seq=number, boot=2, ranges=ranges, status=status)


def odometry(number: int, epoch: int = 0) -> m.Odometry:
    """Return a pose on the x axis, 2 cm further each time."""
    return m.Odometry(
        seq=number, boot=4, x=0.02 * number, y=0.0, heading=0.0, linear=0.4, angular=0.0,
        pose_covariance=(0.0,) * 9, twist_covariance=(0.0,) * 4, epoch=epoch, residual=None,
        slip=False,
    )  # fmt: skip


def event(name: str, level: m.Level, text: str) -> m.Event:
    """Return an event."""
    return m.Event(name=name, level=level, text=text)


def health(second: int) -> m.Health:
    """Return the bridge's health."""
    return m.Health(
        boot=2, service="bridge", version="0.1.0", uptime=float(second), rates={}, counters={},
        lateness=0.0, rss=0,
    )  # fmt: skip
