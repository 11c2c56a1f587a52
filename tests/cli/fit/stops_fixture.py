"""A drive with a STOP, as recorded messages: constant deceleration, 0.1 s after the command."""

import math
from collections.abc import Callable

import msgspec

from cli.fit.streams import Streams
from common.freshness import NS_PER_S
from t2.messages import Command, Message, Mileage, Motion, Velocity

AT_NS = 1_800_000_000 * NS_PER_S  # wall clock of the command


def at(message: Message, seconds: float, begin_s: float = 10.0) -> Message:
    """Return a message sent so many seconds after the command."""
    return msgspec.structs.replace(message, mono_ns=round((begin_s + seconds) * NS_PER_S))


def speed_at(seconds: float, speed: float = 0.8, deceleration: float = 0.5) -> float:
    """Return a speed that falls 0.1 s after the command at 0 s."""
    return round(max(0.0, speed - deceleration * max(0.0, seconds - 0.1)), 3)


def streams(
    *extra: Message,
    sign: int = 1,
    speed: float = 0.8,
    until_s: float = 2.5,
    deceleration: float = 0.5,
    command: Command = Command.STOP,
    begin_s: float = 10.0,
    turns: bool = False,
) -> Streams:
    """Return a drive, or a turn, with a stop at 0 s: 50 velocities and 25 counters a second."""
    made = Streams()

    def add(message: Message, seconds: float) -> None:
        made.add(at(message, seconds, begin_s))

    linear, angular = (0.0, sign * speed) if turns else (sign * speed, 0.0)
    add(Motion(command=Command.RUN, linear=linear, angular=angular, boot=6, seq=1), -0.02)
    add(Motion(command=command, boot=6, seq=2, t_ns=AT_NS), 0.0)
    travel = 0.0
    for number in range(-15, round(until_s * 50)):
        now = number / 50 + 0.005
        moving = sign * speed_at(now, speed, deceleration)
        travel += moving / 50
        linear, angular = (0.0, moving) if turns else (moving, 0.0)
        add(Velocity(linear=linear, angular=angular), now)
        distance, heading = (7.0, travel) if turns else (round(7.0 + travel, 3), 0.0)
        if number % 2 == 0:
            heading = math.remainder(3.0 + heading, math.tau)
            add(Mileage(distance=distance, heading=heading, epoch=0, boot=3), now)
    for message in extra:
        made.add(message)
    return made


def changed(made: Streams, change: Callable[[Velocity, float], Velocity | None]) -> Streams:
    """Return streams with other velocities; None removes one."""
    all_of = [(v, v.mono_ns / NS_PER_S - 10) for v in made.velocities]
    made.velocities = [new for v, now in all_of if (new := change(v, now)) is not None]
    return made
