"""One condition, tried: driving in it, or the link down and up again."""

import time
from dataclasses import dataclass

import msgspec

from common.freshness import NS_PER_S
from sim.requests import Wire
from verification.faults.frames import SPEED, first_stop_s, last_move_s, moves
from verification.faults.remote_host import Address
from verification.faults.stack_fixture import until
from verification.roaming import figures
from verification.roaming.conditions import Outage, Steady
from verification.roaming.figures import STATE, Chain, Drive, Stream
from verification.roaming.hosts import Site

SETTLE_S = 1.0  # in a weather before it counts
PATIENCE_S = 2.0  # standing, before the finger is lifted and put back
LATE_S = 0.2  # the last notes of a time are written by then
ESTOP_S = 5.0
CALM_S = 1.0
SURE_S = 1.0  # that it drives on by then
GIVE_UP_S = 30.0


@dataclass(frozen=True, slots=True)
class Went:
    """How it went in a weather."""

    drive: Drive
    hands: int  # how often the finger was lifted and put back
    speed: float  # m/s, on average
    state: Stream
    odometry: Stream
    chain: Chain
    braked_s: float | None  # from E to BREAK at the board
    told_s: float | None  # from E to "latched" on the laptop
    load_bps: float  # bit/s that the robot put on the way to the laptop
    since_ns: int = 0
    until_ns: int = 0


@dataclass(frozen=True, slots=True)
class Back:
    """How it went when the link was down."""

    told_s: float | None  # from the loss to STOP at the board; None: it drove on
    moved_s: float  # from the loss to the last command to move of those before the return
    heard_s: float | None  # from the return until the laptop heard safety again
    drove_s: float | None  # from the return until it drove
    hands: int  # how often the finger was lifted and put back for that
    chain: Chain
    since_ns: int = 0
    until_ns: int = 0


def steady(it: Site, weather: Steady, seconds: float) -> Went:
    """Drive in a weather for so long, then press the emergency stop in it."""
    calm(it)
    it.lane.ready()
    it.air(*weather.faults)
    hold(it, SETTLE_S)
    it.lane.frames.forget()
    carried = it.carried()
    began_m, since_ns = it.lane.stack.control.truth().distance, time.monotonic_ns()
    hands = hold(it, seconds)
    until_ns, ended_m = time.monotonic_ns(), it.lane.stack.control.truth().distance
    carried = it.carried() - carried
    commands = list(it.lane.frames.follow().commands)
    braked_s, told_s = estop(it)
    calm(it)
    robot, laptop = it.on_robot(since_ns, until_ns), it.on_laptop(since_ns, until_ns)
    return Went(
        drive=figures.drive(robot, laptop, commands, since_ns, until_ns),
        hands=hands,
        speed=(ended_m - began_m) * NS_PER_S / (until_ns - since_ns),
        state=figures.stream(laptop, STATE, since_ns, until_ns),
        odometry=figures.stream(laptop, figures.ODOMETRY, since_ns, until_ns),
        chain=figures.chain(robot, since_ns, until_ns),
        braked_s=braked_s,
        told_s=told_s,
        load_bps=8 * carried * NS_PER_S / (until_ns - since_ns),
        since_ns=since_ns,
        until_ns=until_ns,
    )


def hold(it: Site, seconds: float) -> int:
    """Hold the key; lift it and put it back when it stands; return how often that was."""
    end_s, hands, moved_s = time.monotonic() + seconds, 0, time.monotonic()
    while (now_s := time.monotonic()) < end_s:
        if it.lane.moving():
            moved_s = now_s
        elif now_s - moved_s > PATIENCE_S:
            it.press_again(SPEED)
            hands, moved_s = hands + 1, time.monotonic()
        time.sleep(0.02)
    return hands


def estop(it: Site) -> tuple[float | None, float | None]:
    """Press E; return how long it took to the board, and until the laptop was told."""
    it.lane.frames.forget()
    pressed_ns = time.monotonic_ns()
    it.lane.tell(b"e")

    def braked() -> list[int]:
        commands = it.lane.frames.follow().commands
        return [c.mono_ns for c in commands if c.kind == "brake" and c.mono_ns > pressed_ns]

    def told() -> list[int]:
        return [note.at_ns for note in it.hears(STATE, pressed_ns) if note.latched]

    until(lambda: braked() and told(), ESTOP_S)
    it.lane.ask(0.0)
    return _after_s(braked(), pressed_ns), _after_s(told(), pressed_ns)


def calm(it: Site) -> None:
    """Let the air be good, and reset until none of the stops that were asked for is under way."""
    it.air()
    it.lane.ask(0.0)
    quiet_s = time.monotonic()
    while time.monotonic() - quiet_s < CALM_S:
        if it.lane.latched():
            it.lane.reset()
            quiet_s = time.monotonic()
        time.sleep(0.05)


def outage(it: Site, what: Outage, address: int) -> Back:
    """Cut the link with the key held, mend it, and see what it takes to drive on."""
    calm(it)
    it.lane.ready()
    time.sleep(0.3)
    it.lane.frames.forget()
    cut_ns = time.monotonic_ns()
    if what.seconds:
        it.air(Wire(drop=1.0))
        time.sleep(what.seconds)
    if what.moves:
        it.lane.tell(msgspec.json.encode(Address(address)))
    back_ns = time.monotonic_ns()
    it.air()
    drove_s, hands = _drives_again(it, back_ns)
    until_ns = time.monotonic_ns()
    time.sleep(LATE_S)
    commands = it.lane.frames.commands
    heard = [note.at_ns for note in it.hears(STATE, back_ns) if note.sent_ns > back_ns]
    return Back(
        told_s=first_stop_s(commands, cut_ns),
        moved_s=last_move_s([c for c in commands if c.mono_ns < back_ns], cut_ns),
        heard_s=_after_s(heard, back_ns),
        drove_s=drove_s,
        hands=hands,
        chain=figures.chain(it.on_robot(cut_ns, until_ns), cut_ns, until_ns),
        since_ns=cut_ns,
        until_ns=until_ns,
    )


def _drives_again(it: Site, back_ns: int) -> tuple[float | None, int]:
    """Return how long after the return it drove for good, and how often that took the finger."""
    began_s, hands = time.monotonic(), 0
    since_s = began_s  # that it drives, or stands, without a change
    moving = it.lane.moving()
    while (now_s := time.monotonic()) - began_s < GIVE_UP_S:
        if it.lane.moving() != moving:
            moving, since_s = not moving, now_s
        elif moving and now_s - since_s > SURE_S and now_s - began_s > SURE_S:
            commands = it.lane.frames.commands
            stood = [c.mono_ns for c in commands if not moves(c)]
            drove = [c.mono_ns for c in commands if c.mono_ns > max(stood, default=0)]
            return max(0.0, (drove[0] - back_ns) / NS_PER_S) if stood else 0.0, hands
        elif not moving and now_s - since_s > PATIENCE_S:
            it.press_again(SPEED)
            hands, since_s = hands + 1, time.monotonic()
        time.sleep(0.02)
    return None, hands


def _after_s(times_ns: list[int], since_ns: int) -> float | None:
    return (min(times_ns) - since_ns) / NS_PER_S if times_ns else None
