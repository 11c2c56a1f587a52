"""The bridge's core and its output so far, without sockets or a bus."""

from collections import Counter
from typing import Any

from common import messages as m
from common.config import Sources, load
from common.freshness import NS_PER_S
from common.motion import Command
from common.wire import reports
from common.wire.commands import TO_BOARD, MotionCommand, MotionKind
from common.wire.frame import Frame
from common.wire.framing import Framing, Received
from common.wire.reports import BumperReport, DistanceReport, VelocityReport
from services.bridge.config import BridgeConfig
from services.bridge.core import Core
from services.bridge.output import Output

MS = NS_PER_S // 1000
NOW = 1_000 * NS_PER_S
BOOT, SAFETY = 7, 1

FRAMING = Framing()
HIT, CLEAR, STANDS = map(
    FRAMING.pack, (BumperReport(True), BumperReport(False), VelocityReport(0, 0))
)


class Bench:
    """A core and its output so far."""

    def __init__(self, *sets: str) -> None:
        self.counters: Counter[str] = Counter()
        config = load(BridgeConfig, Sources(environ={}, sets=list(sets))).config
        self.core = Core(config, BOOT, self.counters, NOW)
        self.now_ns = NOW
        self.seq = 0
        self.outs: list[Output] = [self.core.start()]

    def receive(self, *datagrams: bytes, port: int = 0) -> Output:
        """Pass datagrams to the core as the shell does; return the combined output."""
        made = Output()
        for datagram in datagrams:
            hit = self.core.reflex(datagram)
            outs = []
            if hit is not None:
                made.sends.append(hit.brake)
                outs.append(self.core.hit(hit, self.now_ns))
            reported = hit is not None
            outs.append(self.core.datagram(datagram, port, self.now_ns, reported=reported))
            for out in outs:
                made.sends += out.sends
                made.messages += out.messages
                made.events += out.events
                made.answers += out.answers
                made.hit = made.hit or out.hit
        self.outs.append(made)
        return made

    def answer(self, *frames: Frame, port: int = 0) -> Output:
        """Receive these frames, one datagram for each."""
        return self.receive(*map(FRAMING.pack, frames), port=port)

    def tick(self, after_ns: int = 10 * MS, send_errors: int = 0) -> Output:
        """Advance the time, and tick."""
        self.now_ns += after_ns
        out = self.core.tick(self.now_ns, send_errors)
        self.outs.append(out)
        return out

    def move(self, command: Command = Command.RUN, linear: float = 0.0, **fields: Any) -> Output:
        """Receive a motion from safety."""
        self.seq += 1
        values = {"seq": self.seq, "boot": SAFETY, "linear": linear} | fields
        out = self.core.motion(m.Motion(command=command, **values), self.now_ns, self.now_ns)
        self.outs.append(out)
        return out

    def arm(self) -> None:
        """Receive all answers and echoes of the board, then a stop from safety."""
        echoes = reports.UltrasonicBrakeReport(True), reports.BumperBrakeReport(True)
        self.answer(VelocityReport(0, 0), BumperReport(False), DistanceReport(1000, 0), *echoes)
        self.receive(CLEAR, CLEAR, CLEAR)
        self.tick()
        self.move(Command.STOP)
        assert self.link().waiting == ""

    def link(self) -> m.Link:
        """Return the link message of now."""
        (message,) = published(self.core.link(self.now_ns, 0), "link")
        assert isinstance(message, m.Link)
        return message


def frames(out: Output) -> list[Frame]:
    """Return what was sent, read as the board reads it."""
    parts = [part for send in out.sends for part in FRAMING.read(send.datagram, TO_BOARD)]
    assert all(isinstance(part, Received) for part in parts)
    return [part.frame for part in parts if isinstance(part, Received)]


def motions(out: Output) -> list[MotionKind]:
    """Return the motion commands that were sent."""
    return [frame.kind for frame in frames(out) if isinstance(frame, MotionCommand)]


def published(out: Output, stream: str) -> list[Any]:
    """Return the messages of one stream."""
    return [message for name, message, _ in out.messages if name == stream]


def pressed(out: Output) -> list[bool]:
    """Return the contents of the bumper messages."""
    return [message.pressed for message in published(out, "bumper")]


def events(out: Output) -> list[str]:
    """Return the names of the events."""
    return [event.name for event in out.events]
