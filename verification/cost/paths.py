"""The hot paths, as shipped: what comes in, until what goes out is encoded."""

import os
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar
from unittest.mock import Mock, patch

import msgspec

from common import keys, log
from common import messages as m
from common.bus import bus as buses
from common.config import Sources, load
from common.freshness import NS_PER_S
from common.motion import Command
from common.service import Node
from common.settings import Shared
from common.wire import commands, reports
from common.wire.commands import MotionKind
from common.wire.frame import Frame, Side
from common.wire.framing import Framing
from services.bridge import udp
from services.bridge.bridge import Bridge
from services.bridge.config import BridgeConfig
from services.bridge.guard_ipc import Handover
from services.bridge.translate import BumperFilter
from services.odom.config import OdomConfig
from services.odom.odometer import Odometer
from services.safety.config import SafetyConfig
from services.safety.service import SafetyService
from verification.cost.stand_ins import BOOT, Cable, Clock, DroppedLines, Session

MS = NS_PER_S // 1000
MOMENT_NS = 10_000  # between two frames, when the replay must not grow old
ROBOT = "001"
C = TypeVar("C", bound=Shared)

ANSWERS: list[tuple[Frame, Frame]] = [
    (commands.BumperQuery(), reports.BumperReport(False)),
    (commands.DistanceQuery(), reports.DistanceReport(1000, 0)),
    (commands.UltrasonicQuery(), reports.UltrasonicReport((2000,) * 8)),
    (commands.DriverQuery(Side.LEFT), reports.DriverReport(Side.LEFT, 0)),
    (commands.DriverQuery(Side.RIGHT), reports.DriverReport(Side.RIGHT, 0)),
    (commands.UltrasonicBrakeSet(True), reports.UltrasonicBrakeReport(True)),
    (commands.BumperBrakeSet(True), reports.BumperBrakeReport(True)),
]


def node(name: str, root: type[C]) -> Node[C]:
    """Return a service's node with the shipped settings, on nobody's bus and the same each time."""
    loaded = load(root, Sources(environ={}))
    with (
        patch.object(log, "LossyQueue", DroppedLines),
        patch.object(buses, "host_id", lambda: BOOT),
        patch("os.urandom", lambda size: (BOOT << 1).to_bytes(size, "big")),
    ):
        log.configure(loaded.config.log, name)
        return Node(name, loaded)


class BridgePaths:
    """The bridge between a board that answers and a safety service that drives."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        clock.install()
        self._node = node("bridge", BridgeConfig)
        framing = self._framing = Framing()
        answers = {framing.pack(asked): framing.pack(answer) for asked, answer in ANSWERS}
        board = self._node.config.board
        self._cables = [Cable(clock, (board.address, board.port), answers) for _ in range(2)]
        self._guard, heartbeat = os.pipe()
        with patch.object(udp, "_bind", Mock(side_effect=self._cables)):
            self._bridge = Bridge(self._node, Handover((), heartbeat))
        Session(self._node.bus, self._node.loop)
        self._session = Session(self._node.drive, self._node.loop)
        self._seq = 0
        self._frames = {
            name: framing.pack(frame)
            for name, frame in {
                "velocity": reports.VelocityReport(300, 0),
                "hit": reports.BumperReport(True),
                "ultrasonic": reports.UltrasonicReport((2000,) * 8),
            }.items()
        }
        for command in (Command.STOP, Command.RUN):
            self.second(command)
        self._expect(MotionKind.RUN, 300)

    def second(self, command: Command = Command.RUN) -> None:
        """All that a second brings: ticks, queries and answers, velocities, motions, the link."""
        for tick in range(100):
            self.clock.now_ns += 10 * MS
            if tick % 2:
                self._come("velocity")
                self._move(command)
            self._node.loop._call_due()
        os.read(self._guard, 4096)

    def velocity(self) -> None:
        """A measured velocity to the bus."""
        self._take("velocity")

    def ultrasonic(self) -> None:
        """Eight ranges to the bus."""
        self._take("ultrasonic")

    def hit(self) -> None:
        """The first sample of a hit: the reflex, the message, the event, the log."""
        self._bridge._core._bumper = BumperFilter()
        self._take("hit")

    def judge(self) -> None:
        """Safety has judged the hit."""
        self._expect(MotionKind.BREAK)
        self._bridge._core._bumper = BumperFilter()
        self._move(Command.RUN, judged=self._bridge._publishers["bumper"].next_seq)
        self._expect(MotionKind.RUN, 300)

    def motion(self) -> None:
        """A motion message to a RUN frame."""
        self.clock.now_ns += MOMENT_NS
        self._move(Command.RUN)

    def _come(self, name: str) -> None:
        for cable in self._cables:  # the board sends to both ports
            cable.inbox.append(self._frames[name])

    def _take(self, name: str) -> None:
        self.clock.now_ns += MOMENT_NS
        self._come(name)
        self._bridge._read(self.clock.now_ns)

    def _move(self, command: Command, judged: int = 0) -> None:
        self._seq += 1
        now_ns = self.clock.now_ns
        motion = m.Motion(
            command=command, linear=0.3 if command is Command.RUN else 0.0, source="teleop",
            seq=self._seq, boot=BOOT - 1, t_ns=now_ns, mono_ns=now_ns, host=BOOT,
            asked_ns=now_ns, heard_ns=now_ns, judged_ns=now_ns, judged=judged, judged_boot=BOOT,
        )  # fmt: skip
        key = keys.MOTION.on(ROBOT)
        self._session.deliver(key, motion, key)

    def _expect(self, kind: MotionKind, linear_mmps: int = 0) -> None:
        expected = self._framing.pack(commands.MotionCommand(kind, linear_mmps))
        assert self._cables[0].sent == expected, "the replay does not drive any more: mend it"


class SafetyPaths:
    """Safety between a bridge with a clear way and somebody who drives."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        clock.install()
        self._node = node("safety", SafetyConfig)
        reader = self._node.open_bus()
        SafetyService(self._node, reader)
        self._session = Session(self._node.bus, self._node.loop)
        self._link = Session(self._node.drive, self._node.loop)
        Session(reader, self._node.loop)
        self._seq: Counter[str] = Counter()
        for linear in (0.0, 0.3):
            self.second(linear)
        assert self._motion().command is Command.RUN, "the replay does not drive any more: mend it"

    def second(self, linear: float = 0.3) -> None:
        """All that a second brings: samples and requests in, verdicts and states out."""
        for tick in range(100):
            self.clock.now_ns += 10 * MS
            if tick % 20 == 0:
                self._slow()
            if tick % 2:
                self._hear(keys.VELOCITY, m.Velocity(linear=linear, angular=0.0))
                self.bumper()
            if tick % 5 == 0:
                self.ultrasonic()
                self._ask(linear)
            self._node.loop._call_due()

    def bumper(self) -> None:
        """A bumper sample to a motion."""
        self.clock.now_ns += MOMENT_NS
        self._hear(keys.BUMPER, m.Bumper(pressed=False))

    def ultrasonic(self) -> None:
        """Eight ranges to a motion."""
        self.clock.now_ns += MOMENT_NS
        self._hear(keys.ULTRASONIC, m.Ultrasonic(ranges=(2.0,) * 8, status=("ok",) * 8))

    def _slow(self) -> None:
        link = m.Link(state="up", board="", epoch=0, armed=True, waiting="", rates={},
                      rejected={}, round_trip=None)  # fmt: skip
        self._hear(keys.LINK, link)
        self._hear(keys.SWITCHES, m.Switches(ultrasonic_brake=True, bumper_brake=True))
        for side in ("left", "right"):
            self._hear(keys.DRIVER, m.Driver(faults=(), bits=0), side=side)

    def _ask(self, linear: float) -> None:
        told = self._session.sent.get(keys.SAFETY.on(ROBOT))
        if told is not None:
            echo = msgspec.msgpack.decode(told, type=m.SafetyState).heartbeat
            drive = m.Drive(linear=linear, angular=0.0, echo=echo)
            self._hear(keys.DRIVE, drive, source="teleop")

    def _hear(self, topic: keys.Topic[Any], message: m.Message, **names: str) -> None:
        key = topic.on(ROBOT, **names)
        self._seq[key] += 1
        one = stamped(message, self._seq[key], self.clock.now_ns)
        subscription = topic.on(ROBOT, source="*") if topic is keys.DRIVE else key
        session = self._link if topic.publisher == "bridge" else self._session
        session.deliver(key, one, subscription)

    def _motion(self) -> m.Motion:
        return msgspec.msgpack.decode(self._session.sent[keys.MOTION.on(ROBOT)], type=m.Motion)


class OdomPaths:
    """Odometry behind a bridge that drives an arc."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        clock.install()
        self._node = node("odom", OdomConfig)
        Odometer(self._node)
        self._session = Session(self._node.bus, self._node.loop)
        self._steps = 0
        for _ in range(100):
            self.step()
        assert keys.ODOMETRY.on(ROBOT) in self._session.sent, "odometry is silent: mend the replay"

    def step(self) -> None:
        """A velocity and the counters to pose and twist: all of 20 ms."""
        self.clock.now_ns += 20 * MS
        self._steps += 1
        way_m = 0.006 * self._steps
        for topic, message in (
            (keys.VELOCITY, m.Velocity(linear=0.3, angular=0.1)),
            (keys.MILEAGE, m.Mileage(distance=way_m, heading=way_m / 3, epoch=0)),
        ):
            one = stamped(message, self._steps, self.clock.now_ns)
            self._session.deliver(topic.on(ROBOT), one, topic.on(ROBOT))
        self._node.loop._call_due()


def stamped(message: m.Message, seq: int, now_ns: int) -> m.Message:
    """Return it with a header, as a publisher on this host makes it."""
    return msgspec.structs.replace(
        message, seq=seq, boot=BOOT, t_ns=now_ns, mono_ns=now_ns, host=BOOT
    )


Step = Callable[[], None]


@dataclass(frozen=True, slots=True)
class Walk:
    """One hot path, to be walked so many times by a clock of its service's own."""

    name: str
    clock: Clock
    step: Step
    times: int = 20
    mend: Step = lambda: None  # puts right what a step leaves behind


def walks() -> list[Walk]:
    """Return all hot paths, ready to be walked; install the clock of each before."""
    bridge, safety, odom = BridgePaths(Clock()), SafetyPaths(Clock()), OdomPaths(Clock())
    return [
        Walk("bridge_velocity", bridge.clock, bridge.velocity),
        Walk("bridge_ultrasonic", bridge.clock, bridge.ultrasonic),
        Walk("bridge_hit", bridge.clock, bridge.hit, mend=bridge.judge),
        Walk("bridge_motion", bridge.clock, bridge.motion),
        Walk("bridge_second", bridge.clock, bridge.second, times=1),
        Walk("safety_bumper", safety.clock, safety.bumper),
        Walk("safety_ultrasonic", safety.clock, safety.ultrasonic),
        Walk("safety_second", safety.clock, safety.second, times=1),
        Walk("odom_step", odom.clock, odom.step, times=50),
    ]
