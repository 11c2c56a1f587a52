"""Stops of the simulated vehicle in simulated time, as recorded messages; and exact stops."""

import random
from collections.abc import Callable
from dataclasses import dataclass, field

import msgspec

from cli.commission.stops import Streams
from common.freshness import NS_PER_S
from common.messages import Message, Mileage, Motion, Velocity
from common.motion import Command
from common.wire.commands import DistanceQuery, MotionCommand, MotionKind
from common.wire.frame import Frame
from common.wire.reports import DistanceReport, VelocityReport
from sim.requests import Wire
from tests.sim.sim_fixture import SimFixture, model

KINDS = {Command.STOP: MotionKind.STOP, Command.BRAKE: MotionKind.BREAK}
TICK_NS = NS_PER_S // 100
DRIVE_S, STAND_S = 0.3, 0.3  # before the command, and after standstill
PAUSE_NS = 10 * NS_PER_S  # between two stops


@dataclass
class StopMaker:
    """Drives and stops; ``streams`` has what a recorder would receive."""

    seed: int = 1
    delay: float = 0.1  # s, of the command
    jitter: float = 0.04  # s, at most, on top; uniform
    coast: float = 0.8  # m/s^2
    streams: Streams = field(default_factory=Streams)
    _offset_ns: int = 0

    def __post_init__(self) -> None:
        self._random = random.Random(self.seed)

    def stop(self, speed: float, command: Command = Command.STOP) -> "StopMaker":
        """Drive at this speed (m/s) and stop, after a random part of a tick."""
        drive = {"coast": self.coast, "acceleration": 100.0}
        seed = self._random.randrange(10**6)
        it = SimFixture(vehicle=model(drive=drive), seed=seed, ports=(4002,))
        self._add(it, Motion(command=Command.RUN, linear=speed))
        it.run(speed)
        self._drive(it, DRIVE_S)
        it.simulation.to_board.faults = Wire(delay=self.delay, jitter=self.jitter)
        it.now_ns += self._random.randrange(TICK_NS)
        self._add(it, Motion(command=command))
        it.say(MotionCommand(KINDS[command]))
        it.now_ns = it.simulation.now_ns
        lasting_s = self.delay + self.jitter + abs(speed) / self.coast + STAND_S
        self._drive(it, lasting_s)
        self._offset_ns += PAUSE_NS
        return self

    def _drive(self, it: SimFixture, seconds: float) -> None:
        for tick in range(round(seconds / 0.01)):
            frames: list[Frame] = it.after(0.01)
            if tick % 4 == 0:  # the counters are queried at 25 Hz
                frames.append(it.simulation.board.answer(DistanceQuery()))  # type: ignore[arg-type]
            for frame in frames:
                if isinstance(frame, VelocityReport):
                    self._add(it, Velocity(linear=frame.linear_mmps / 1000, angular=0.0))
                elif isinstance(frame, DistanceReport):
                    distance = frame.distance_mm / 1000
                    self._add(it, Mileage(distance=distance, heading=0.0, epoch=0))

    def _add(self, it: SimFixture, message: Motion | Velocity | Mileage) -> None:
        at_ns = it.now_ns + self._offset_ns
        fields = {name: getattr(message, name) for name in message.__struct_fields__}
        self.streams.add(type(message)(**fields | {"mono_ns": at_ns, "boot": self.seed}))


RUN = Motion(command=Command.RUN, linear=0.8)


def at(message: Message, seconds: float) -> Message:
    """Return a message sent so many seconds after the command."""
    return msgspec.structs.replace(message, mono_ns=NS_PER_S * 10 + round(seconds * NS_PER_S))


def speed_at(seconds: float, speed: float = 0.8) -> float:
    """Return a speed that falls by 0.5 m/s^2, 0.1 s after the command at 0 s."""
    return round(max(0.0, speed - 0.5 * max(0.0, seconds - 0.1)), 3)


def streams(*extra: Message, sign: int = 1, speed: float = 0.8, until_s: float = 2.5) -> Streams:
    """Return a drive with a STOP at 0 s: 50 velocities and 25 counters a second."""
    made = Streams()
    made.add(at(msgspec.structs.replace(RUN, linear=sign * speed), -0.02))
    made.add(at(Motion(command=Command.STOP, boot=6), 0.0))
    distance = 7.0
    for number in range(-15, round(until_s * 50)):
        now = number / 50 + 0.005
        linear = sign * speed_at(now, speed)
        distance += linear / 50
        made.add(at(Velocity(linear=linear, angular=0.0), now))
        if number % 2 == 0:
            made.add(at(Mileage(distance=round(distance, 3), heading=0.0, epoch=0, boot=3), now))
    for message in extra:
        made.add(message)
    return made


def changed(made: Streams, change: Callable[[Velocity, float], Velocity | None]) -> Streams:
    """Return streams with other velocities; None removes one."""
    all_of = [(v, v.mono_ns / NS_PER_S - 10) for v in made.velocities]
    made.velocities = [new for v, now in all_of if (new := change(v, now)) is not None]
    return made
