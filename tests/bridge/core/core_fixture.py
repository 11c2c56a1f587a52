"""The bridge's core and its output so far, without sockets or a bus."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from msgspec import Struct

from common.config import Sources, load
from common.freshness import NS_PER_S
from common.motion import RUN, STOP
from common.wire import framing, reports
from common.wire.commands import TO_BOARD, MotionCommand, MotionKind
from common.wire.frame import Frame
from common.wire.framing import Received
from common.wire.reports import BumperReport, DistanceReport, VelocityReport
from services.bridge.config import BridgeConfig
from services.bridge.core.core import Core
from services.bridge.core.output import Event, Output, Publish, Reacted, Refuse, Reply, Send
from t2 import messages as m
from t2.messages import Command
from t2.words import render

MS = NS_PER_S // 1000
NOW = 1_000 * NS_PER_S
BOOT, SAFETY = 7, 1
HIT, CLEAR, STANDS = map(
    framing.pack, (BumperReport(True), BumperReport(False), VelocityReport(0, 0))
)


class Bench:
    """A core and its outputs so far."""

    def __init__(self, *sets: str) -> None:
        self.counters: Counter[str] = Counter()
        config = load(BridgeConfig, Sources(environ={}, sets=list(sets))).config
        self.core = Core(config, BOOT, self.counters, NOW)
        self.now_ns = NOW
        self.seq = 0
        self.outputs: list[Output] = []
        self.carried_out([self.core.motions.order(STOP)])

    def carried_out(self, outputs: Iterable[Output]) -> list[Output]:
        """Carry out outputs as the shell does; return them."""
        made = []
        for output in outputs:
            made.append(output)
            if isinstance(output, Reply):
                output.caller.replies.append(output.reply)
            elif isinstance(output, Refuse):
                output.caller.refusals.append(render(output.reasons))
        self.outputs += made
        return made

    def receive(self, *datagrams: bytes, port: int = 0) -> list[Output]:
        """Receive datagrams now."""
        return self.carried_out(
            output
            for datagram in datagrams
            for output in self.core.datagram(datagram, port, self.now_ns)
        )

    def answer(self, *frames: Frame, port: int = 0) -> list[Output]:
        """Receive these frames, one datagram for each."""
        return self.receive(*map(framing.pack, frames), port=port)

    def tick(self, after_ns: int = 10 * MS) -> list[Output]:
        """Advance the time, and tick."""
        self.now_ns += after_ns
        return self.carried_out(self.core.tick(self.now_ns))

    def move(self, command: Command = RUN, linear: float = 0.0, **fields: Any) -> list[Output]:
        """Receive a motion from safety."""
        self.seq += 1
        values = {"seq": self.seq, "boot": SAFETY, "linear": linear} | fields
        motion = m.Motion(command=command, **values)
        return self.carried_out(self.core.motions.on_motion(motion, self.now_ns, self.now_ns))

    def estop(self) -> list[Output]:
        """Receive an emergency stop."""
        return self.carried_out(self.core.motions.on_estop(self.now_ns))

    def switch(self, caller: "Caller", **request: Any) -> list[Output]:
        """Receive a call that sets the brakes."""
        call = m.SwitchesRequest(**request)
        return self.carried_out(self.core.calls.on_switches(call, caller, self.now_ns))

    def lamp(self, caller: "Caller") -> list[Output]:
        """Receive a call that sets a lamp."""
        return self.carried_out(
            self.core.calls.on_led(m.LedRequest(channel=1, mode=0), caller, self.now_ns)
        )

    def arm(self) -> None:
        """Receive all answers and confirmations of the board, then a stop from safety."""
        switches = reports.UltrasonicBrakeReport(True), reports.BumperBrakeReport(True)
        self.answer(VelocityReport(0, 0), BumperReport(False), DistanceReport(1000, 0), *switches)
        self.receive(CLEAR, CLEAR, CLEAR)
        self.tick()
        self.move(STOP)
        assert self.link().waiting == ""

    def link(self) -> m.Link:
        """Return the link message of now."""
        return self.core.link(self.now_ns)


@dataclass
class Caller:
    """Records what it is answered."""

    replies: list[Struct] = field(default_factory=list)
    refusals: list[str] = field(default_factory=list)


def frames(outputs: Iterable[Output]) -> list[Frame]:
    """Return what was sent, read as the board reads it."""
    sends = [output for output in outputs if isinstance(output, Send)]
    parts = [part for send in sends for part in framing.read(send.datagram, TO_BOARD)]
    assert all(isinstance(part, Received) for part in parts)
    return [part.frame for part in parts if isinstance(part, Received)]


def motions(outputs: Iterable[Output]) -> list[MotionKind]:
    """Return the motion commands that were sent."""
    return [frame.kind for frame in frames(outputs) if isinstance(frame, MotionCommand)]


def published(outputs: Iterable[Output], stream: str) -> list[Any]:
    """Return the messages of one stream."""
    publishes = [output for output in outputs if isinstance(output, Publish)]
    return [output.message for output in publishes if output.stream == stream]


def pressed(outputs: Iterable[Output]) -> list[bool]:
    """Return the contents of the bumper messages."""
    return [message.pressed for message in published(outputs, "bumper")]


def events(outputs: Iterable[Output]) -> list[str]:
    """Return the names of the events."""
    return [output.name for output in outputs if isinstance(output, Event)]


def reactions(outputs: Iterable[Output]) -> list[str]:
    """Return the names of the reactions."""
    return [output.name for output in outputs if isinstance(output, Reacted)]
