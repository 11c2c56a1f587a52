"""The hot paths as shipped: from the input until the output is encoded."""

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
from services.bridge.guard_ipc import Inherited
from services.bridge.translate import BumperFilter
from services.odom.config import OdomConfig
from services.odom.odometer import Odometer
from services.safety.config import SafetyConfig
from services.safety.service import SafetyService
from verification.cost.stand_ins import BOOT, BoardSocket, Clock, DroppedLines, Session

MS = NS_PER_S // 1000
STEP_NS = 1_100_000  # between two samples: handled in place, and none becomes stale meanwhile
ROBOT = "001"
C = TypeVar("C", bound=Shared)
M = TypeVar("M", bound=m.Message)

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
    """Return a service's node with the shipped settings, without a bus and deterministic."""
    loaded = load(root, Sources(environ={}))
    with (
        patch.object(log, "LossyQueue", DroppedLines),
        patch.object(buses, "host_id", lambda: BOOT),
        patch("os.urandom", lambda size: (BOOT << 1).to_bytes(size, "big")),
    ):
        log.configure(loaded.config.log, name)
        return Node(name, loaded, in_place=True)


class BridgePaths:
    """The bridge between a board that answers and a safety service that drives."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        clock.install()
        self._node = node("bridge", BridgeConfig)
        framing = self._framing = Framing()
        answers = {framing.pack(asked): framing.pack(answer) for asked, answer in ANSWERS}
        board = self._node.config.board
        self._sockets = [BoardSocket(clock, (board.address, board.port), answers) for _ in range(2)]
        self._guard, heartbeat = os.pipe()
        with patch.object(udp, "_bind", Mock(side_effect=self._sockets)):
            self._bridge = Bridge(self._node, Inherited((), heartbeat))
        Session(self._node.bus, self._node.loop)
        self.session = Session(self._node.drive, self._node.loop)
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
        """One second: ticks, queries and answers, velocities, motions, the link."""
        for _ in range(50):
            self.clock.now_ns += 20 * MS
            self._node.loop._call_due()
            self.take("velocity")  # and the board's answers
            self._move(command)
        os.read(self._guard, 4096)

    def velocity(self) -> None:
        """A measured velocity to the bus."""
        self.take("velocity")

    def ultrasonic(self) -> None:
        """Eight ranges to the bus."""
        self.take("ultrasonic")

    def hit(self) -> None:
        """The first sample of a hit: the reflex, the message, the event, the log."""
        self.release_bumper()
        self.take("hit")

    def acknowledge(self) -> None:
        """A motion of safety that acknowledges the hit."""
        self._expect(MotionKind.BREAK)
        self.release_bumper()
        self._move(Command.RUN, judged=self._bridge._publishers["bumper"].next_seq)
        self._expect(MotionKind.RUN, 300)

    def motion(self) -> None:
        """A motion message to a RUN frame."""
        self.clock.now_ns += STEP_NS
        self._move(Command.RUN)

    def release_bumper(self) -> None:
        """Make the next sample of a hit a new one."""
        self._bridge._core._bumper = BumperFilter()

    def _receive(self, name: str) -> None:
        for sock in self._sockets:  # the board sends to both ports
            sock.inbox.append(self._frames[name])

    def take(self, name: str) -> None:
        """Process this frame, on both ports."""
        self.clock.now_ns += STEP_NS
        self._receive(name)
        self._bridge._read(self.clock.now_ns, 0, 1)

    def _move(self, command: Command, judged: int = 0) -> None:
        now_ns = self.clock.now_ns
        motion = self.from_authority(m.Motion(
            command=command, linear=0.3 if command is Command.RUN else 0.0, source="teleop",
            asked_ns=now_ns, heard_ns=now_ns, judged_ns=now_ns, judged=judged, judged_boot=BOOT,
        ))  # fmt: skip
        key = keys.MOTION.on(ROBOT)
        self.session.deliver(key, motion, key)

    def from_authority(self, motion: m.Motion) -> m.Motion:
        """Return the motion as the next one of the safety service that drives here."""
        self._seq += 1
        return msgspec.structs.replace(stamped(motion, self._seq, self.clock.now_ns), boot=BOOT - 1)

    def _expect(self, kind: MotionKind, linear_mmps: int = 0) -> None:
        expected = self._framing.pack(commands.MotionCommand(kind, linear_mmps))
        assert self._sockets[0].sent == expected, "the replay does not drive any more"


class SafetyPaths:
    """Safety between a bridge without obstacles and a motion source."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        clock.install()
        self._node = node("safety", SafetyConfig)
        reader = self._node.open_bus()
        SafetyService(self._node, reader)
        self.session = Session(self._node.bus, self._node.loop)
        self.link = Session(self._node.drive, self._node.loop)
        Session(reader, self._node.loop)
        self._seq: Counter[str] = Counter()
        for linear in (0.0, 0.3):
            self.second(linear)
        assert self._motion().command is Command.RUN, "the replay does not drive any more"

    def second(self, linear: float = 0.3) -> None:
        """One second: samples and requests in, verdicts and states out."""
        for tick in range(100):
            self.clock.now_ns += 10 * MS
            if tick % 20 == 0:
                self._slow()
            if tick % 2:
                self._deliver(keys.VELOCITY, m.Velocity(linear=linear, angular=0.0))
                self.bumper()
            if tick % 5 == 0:
                self.ultrasonic()
                self._request(linear)
            self._node.loop._call_due()

    def bumper(self) -> None:
        """A bumper sample to a motion."""
        self.clock.now_ns += STEP_NS
        self._deliver(keys.BUMPER, m.Bumper(pressed=False))

    def ultrasonic(self) -> None:
        """Eight ranges to a motion."""
        self.clock.now_ns += STEP_NS
        self._deliver(keys.ULTRASONIC, m.Ultrasonic(ranges=(2.0,) * 8, status=("ok",) * 8))

    def _slow(self) -> None:
        link = m.Link(state="up", board="", epoch=0, armed=True, waiting="", rates={},
                      rejected={}, round_trip=None)  # fmt: skip
        self._deliver(keys.LINK, link)
        self._deliver(keys.SWITCHES, m.Switches(ultrasonic_brake=True, bumper_brake=True))
        for side in ("left", "right"):
            self._deliver(keys.DRIVER, m.Driver(faults=(), bits=0), side=side)

    def _request(self, linear: float) -> None:
        state = self.session.sent.get(keys.SAFETY.on(ROBOT))
        if state is not None:
            echo = msgspec.msgpack.decode(state, type=m.SafetyState).heartbeat
            drive = m.Drive(linear=linear, angular=0.0, echo=echo)
            self._deliver(keys.DRIVE, drive, source="teleop")

    def _deliver(self, topic: keys.Topic[Any], message: m.Message, **names: str) -> None:
        key = topic.on(ROBOT, **names)
        self._seq[key] += 1
        one = stamped(message, self._seq[key], self.clock.now_ns)
        subscription = topic.on(ROBOT, source="*") if topic is keys.DRIVE else key
        session = self.link if topic.publisher == "bridge" else self.session
        session.deliver(key, one, subscription)

    def _motion(self) -> m.Motion:
        return msgspec.msgpack.decode(self.session.sent[keys.MOTION.on(ROBOT)], type=m.Motion)


class OdomPaths:
    """Odometry of a vehicle that drives an arc."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        clock.install()
        self._node = node("odom", OdomConfig)
        Odometer(self._node)
        self.session = Session(self._node.bus, self._node.loop)
        self._steps = 0
        for _ in range(100):
            self.step()
        assert keys.ODOMETRY.on(ROBOT) in self.session.sent, "odometry is silent"

    def step(self) -> None:
        """A velocity and the counters to pose and twist: 20 ms."""
        self.clock.now_ns += 20 * MS
        self._steps += 1
        distance_m = 0.006 * self._steps
        for topic, message in (
            (keys.VELOCITY, m.Velocity(linear=0.3, angular=0.1)),
            (keys.MILEAGE, m.Mileage(distance=distance_m, heading=distance_m / 3, epoch=0)),
        ):
            one = stamped(message, self._steps, self.clock.now_ns)
            self.session.deliver(topic.on(ROBOT), one, topic.on(ROBOT))
        self._node.loop._call_due()


def stamped(message: M, seq: int, now_ns: int) -> M:
    """Return the message with a header of a publisher on this host."""
    return msgspec.structs.replace(
        message, seq=seq, boot=BOOT, t_ns=now_ns, mono_ns=now_ns, host=BOOT
    )


Step = Callable[[], None]


@dataclass(frozen=True, slots=True)
class HotPath:
    """One hot path: a step and its number of repetitions, with its service's clock."""

    name: str
    clock: Clock
    step: Step
    times: int = 20
    restore: Step = lambda: None  # restores the state after a step


def hot_paths() -> list[HotPath]:
    """Return all hot paths; install the clock of each before running it."""
    bridge, safety, odom = BridgePaths(Clock()), SafetyPaths(Clock()), OdomPaths(Clock())
    return [
        HotPath("bridge_velocity", bridge.clock, bridge.velocity),
        HotPath("bridge_ultrasonic", bridge.clock, bridge.ultrasonic),
        HotPath("bridge_hit", bridge.clock, bridge.hit, restore=bridge.acknowledge),
        HotPath("bridge_motion", bridge.clock, bridge.motion),
        HotPath("bridge_second", bridge.clock, bridge.second, times=1),
        HotPath("safety_bumper", safety.clock, safety.bumper),
        HotPath("safety_ultrasonic", safety.clock, safety.ultrasonic),
        HotPath("safety_second", safety.clock, safety.second, times=1),
        HotPath("odom_step", odom.clock, odom.step, times=50),
    ]
