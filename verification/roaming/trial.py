"""One trial: driving under a condition, or an outage of the link."""

import time
from dataclasses import dataclass

import msgspec

from common import clock
from common.freshness import NS_PER_S
from sim.requests import Wire
from verification.faults.remote_host import Address
from verification.faults.stack_fixture import SPEED_MPS
from verification.harness.trace import first_stop_s, last_move_s, moves
from verification.harness.waiting import becomes_true
from verification.roaming import figures
from verification.roaming.conditions import Condition, Outage
from verification.roaming.figures import STATE, ControlChain, Drive, Stream
from verification.roaming.hosts import TwoHosts

SETTLE_S = 1.0  # under a condition before the measurement
PATIENCE_S = 2.0  # standing, before the key is pressed again
LATE_S = 0.2  # until the last entries of a period are written
ESTOP_S = 5.0
QUIET_S = 1.0
SURE_S = 1.0  # of continuous driving or standing
GIVE_UP_S = 30.0


@dataclass(frozen=True, slots=True)
class DriveResult:
    """Result of driving under a condition."""

    drive: Drive
    presses: int  # additional key presses
    speed: float  # m/s, on average
    state: Stream
    odometry: Stream
    chain: ControlChain
    braked_s: float | None  # from E to BRAKE at the board
    confirmed_s: float | None  # from E to the latched state on the laptop
    load_bps: float  # bit/s from the robot to the laptop
    since_ns: int = 0
    until_ns: int = 0


@dataclass(frozen=True, slots=True)
class OutageResult:
    """How it result when the link was down."""

    stopped_s: float | None  # from the loss to STOP at the board; None: it drove on
    moved_s: float  # from the loss to the last moving command before the return
    received_s: float | None  # from the return until the laptop received safety's state
    drove_s: float | None  # from the return until it drove
    presses: int  # additional key presses until then
    chain: ControlChain
    since_ns: int = 0
    until_ns: int = 0


def steady(it: TwoHosts, condition: Condition, seconds: float) -> DriveResult:
    """Drive under a condition, then press the emergency stop."""
    settle(it)
    it.fixture.ready()
    it.disturb(*condition.faults)
    hold(it, SETTLE_S)
    it.fixture.frames.forget()
    carried = it.carried()
    began_m, since_ns = it.fixture.running.control.truth().distance, clock.now_ns()
    presses = hold(it, seconds)
    until_ns, ended_m = clock.now_ns(), it.fixture.running.control.truth().distance
    carried = it.carried() - carried
    commands = list(it.fixture.frames.follow().commands)
    braked_s, confirmed_s = estop(it)
    settle(it)
    robot, laptop = it.on_robot(since_ns, until_ns), it.on_laptop(since_ns, until_ns)
    return DriveResult(
        drive=figures.drive(robot, laptop, commands, since_ns, until_ns),
        presses=presses,
        speed=(ended_m - began_m) * NS_PER_S / (until_ns - since_ns),
        state=figures.stream(laptop, STATE, since_ns, until_ns),
        odometry=figures.stream(laptop, figures.ODOMETRY, since_ns, until_ns),
        chain=figures.control_chain(robot, since_ns, until_ns),
        braked_s=braked_s,
        confirmed_s=confirmed_s,
        load_bps=8 * carried * NS_PER_S / (until_ns - since_ns),
        since_ns=since_ns,
        until_ns=until_ns,
    )


def hold(it: TwoHosts, seconds: float) -> int:
    """Hold the key; press it again when the vehicle stands; return the number of presses."""
    end_s, presses, moved_s = time.monotonic() + seconds, 0, time.monotonic()
    while (now_s := time.monotonic()) < end_s:
        if it.fixture.moving():
            moved_s = now_s
        elif now_s - moved_s > PATIENCE_S:
            it.press_again(SPEED_MPS)
            presses, moved_s = presses + 1, time.monotonic()
        time.sleep(0.02)
    return presses


def estop(it: TwoHosts) -> tuple[float | None, float | None]:
    """Press E; return the time to the board, and to the confirmation on the laptop."""
    it.fixture.frames.forget()
    pressed_ns = clock.now_ns()
    it.fixture.send_line(b"e")

    def braked() -> list[int]:
        commands = it.fixture.frames.follow().commands
        return [c.mono_ns for c in commands if c.kind == "brake" and c.mono_ns > pressed_ns]

    def confirmed() -> list[int]:
        return [entry.at_ns for entry in it.received(STATE, pressed_ns) if entry.latched]

    becomes_true(lambda: braked() and confirmed(), ESTOP_S)
    it.fixture.request(0.0)
    return _after_s(braked(), pressed_ns), _after_s(confirmed(), pressed_ns)


def settle(it: TwoHosts) -> None:
    """Remove link faults, and reset until no latch is left."""
    it.disturb()
    it.fixture.request(0.0)
    quiet_s = time.monotonic()
    while time.monotonic() - quiet_s < QUIET_S:
        if it.fixture.latched():
            it.fixture.reset()
            quiet_s = time.monotonic()
        time.sleep(0.05)


def outage(it: TwoHosts, what: Outage, address: int) -> OutageResult:
    """Cut the link while the key is held, restore it, and wait until the vehicle drives."""
    settle(it)
    it.fixture.ready()
    time.sleep(0.3)
    it.fixture.frames.forget()
    cut_ns = clock.now_ns()
    if what.seconds:
        it.disturb(Wire(drop=1.0))
        time.sleep(what.seconds)
    if what.moves:
        it.fixture.send_line(msgspec.json.encode(Address(address)))
    back_ns = clock.now_ns()
    it.disturb()
    drove_s, presses = _drives_again(it, back_ns)
    until_ns = clock.now_ns()
    time.sleep(LATE_S)
    commands = it.fixture.frames.commands
    received = [entry.at_ns for entry in it.received(STATE, back_ns) if entry.sent_ns > back_ns]
    return OutageResult(
        stopped_s=first_stop_s(commands, cut_ns),
        moved_s=last_move_s([c for c in commands if c.mono_ns < back_ns], cut_ns),
        received_s=_after_s(received, back_ns),
        drove_s=drove_s,
        presses=presses,
        chain=figures.control_chain(it.on_robot(cut_ns, until_ns), cut_ns, until_ns),
        since_ns=cut_ns,
        until_ns=until_ns,
    )


def _drives_again(it: TwoHosts, back_ns: int) -> tuple[float | None, int]:
    """Return the time from the return to continuous driving, and the number of key presses."""
    began_s, presses = time.monotonic(), 0
    since_s = began_s  # start of the current driving or standing
    moving = it.fixture.moving()
    while (now_s := time.monotonic()) - began_s < GIVE_UP_S:
        if it.fixture.moving() != moving:
            moving, since_s = not moving, now_s
        elif moving and now_s - since_s > SURE_S and now_s - began_s > SURE_S:
            commands = it.fixture.frames.commands
            stood = [c.mono_ns for c in commands if not moves(c)]
            drove = [c.mono_ns for c in commands if c.mono_ns > max(stood, default=0)]
            return max(0.0, (drove[0] - back_ns) / NS_PER_S) if stood else 0.0, presses
        elif not moving and now_s - since_s > PATIENCE_S:
            it.press_again(SPEED_MPS)
            presses, since_s = presses + 1, time.monotonic()
        time.sleep(0.02)
    return None, presses


def _after_s(times_ns: list[int], since_ns: int) -> float | None:
    return (min(times_ns) - since_ns) / NS_PER_S if times_ns else None
