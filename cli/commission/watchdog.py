"""The trial of the board's watchdog, with the stack down: this tool is the board's only master.

The bridge never stops sending, by design, so it cannot be asked what the board does when commands
end. Here its ports are taken instead, which also proves that no bridge runs. Three things keep the
wheels from being left with a RUN:

- every way out of the trial sends BREAK, signals and bugs of this program included;
- a second process holds the same sockets, and sends BREAK when this one dies or hangs;
- the board's own emergency brakes are switched on first, and must be echoed.
"""

import os
import select
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from cli.commission.operator import Operator
from cli.commission.verdict import Verdict, judged
from cli.commission.watchdog_plan import BREAK, Sample, Trial, judge_trial
from cli.settings import Everything
from common.errors import WireError
from common.freshness import NS_PER_S
from common.wire import commands, reports
from common.wire.frame import Frame
from common.wire.framing import Framing, Received
from services.bridge.translate import Translator
from services.bridge.udp import Sockets

LOOK_S = 0.005
HEARD_S = 3.0
ECHO_S = 2.0
AGAIN_S = 0.1
WARN_S, GIVE_UP_S = 3.0, 10.0  # of BREAK, while it does not stand; the board holds the last one
GUARD_S = 3.0  # the trial's RUN and silence take 2 s
LAST_BREAKS, LAST_S = 10, 0.05
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
PHRASE = "wheels off the ground"


class Master:
    """The board's only master, over the bridge's own ports."""

    def __init__(self, config: Everything) -> None:
        """Take the ports; raise ``LinkError`` when a bridge has them."""
        self._sockets = Sockets(config.board)
        self._framing = Framing(config.wire.crc, config.wire.crc_covers)
        limits = config.bridge.max_linear, config.bridge.max_angular
        self._translator = Translator(config.wire, config.vehicle, *limits)
        self._port = 0
        self.rejected = 0

    def close(self) -> None:
        """Give the ports back."""
        self._sockets.close()

    def send(self, frame: Frame) -> None:
        """Send from the port that was heard last."""
        self._sockets.send(self._framing.pack(frame), self._port)

    def listen(self, seconds: float) -> Iterator[Frame]:
        """Wait for the board, at most so long, and yield what it said."""
        ready, _, _ = select.select(self._sockets.sockets, [], [], seconds)
        for sock in ready:
            port = self._sockets.sockets.index(sock)
            for datagram, _, _ in self._sockets.read(port):
                for part in self._framing.read(datagram, reports.FROM_BOARD):
                    if isinstance(part, Received):
                        self._port = port
                        yield part.frame
                    else:
                        self.rejected += 1

    def velocities(self, seconds: float) -> Iterator[Sample]:
        """Wait likewise, and yield the velocities alone."""
        for frame in self.listen(seconds):
            if isinstance(frame, reports.VelocityReport):
                try:
                    velocity = self._translator.velocity(frame)
                except WireError:
                    continue  # implausible: the header has no CRC
                yield Sample(velocity.linear, velocity.angular, time.monotonic_ns())

    def is_heard(self) -> str:
        """Return why the trial cannot begin: the board is not heard, or the vehicle moves."""
        end_s = time.monotonic() + HEARD_S
        while time.monotonic() < end_s:
            self.send(BREAK)
            for sample in self.velocities(AGAIN_S):
                if sample.stands:
                    return ""
        bad = f"; {self.rejected} byte runs were no frames" if self.rejected else ""
        return f"The board does not say that the vehicle stands, within {HEARD_S:g} s{bad}."

    def brakes_on(self) -> str:
        """Switch the board's own emergency brakes on; return which were not echoed."""
        kinds = (reports.UltrasonicBrakeReport, reports.BumperBrakeReport)
        echoed: set[type[Frame]] = set()
        end_s = time.monotonic() + ECHO_S
        while len(echoed) < len(kinds) and time.monotonic() < end_s:
            self.send(commands.UltrasonicBrakeSet(True))
            self.send(commands.BumperBrakeSet(True))
            for frame in self.listen(AGAIN_S):
                if isinstance(frame, kinds) and frame.on:
                    echoed.add(type(frame))
        missing = [kind.__name__ for kind in kinds if kind not in echoed]
        return f"The board did not send: {', '.join(missing)}." if missing else ""


def watchdog(master: Master, operator: Operator) -> Verdict:
    """Run the trial on an operator's typed word."""
    fact = "The stack is down. The wheels will turn, and for a second nobody tells them to stop."
    if not operator.confirm(fact, PHRASE):
        return judged(["Not confirmed: nothing was moved."], "")
    if reason := master.is_heard() or master.brakes_on():
        return judged([reason], "")
    operator.say("Turning. ctrl-c stops.")
    with guarded(lambda: master.send(BREAK)), signalled() as signals:
        trial = _try(master, operator, signals)
    verdict = judge_trial(trial)
    if trial.phase != "over":
        return judged([verdict.text, "IT DID NOT STAND after BREAK."], "", verdict.data)
    return verdict


def _try(master: Master, operator: Operator, signals: list[int]) -> Trial:
    trial = Trial(time.monotonic_ns())
    warned = False
    try:
        while trial.phase != "over":
            if signals:
                trial = trial.end("ctrl-c", time.monotonic_ns())
            trial, command = trial.tick(time.monotonic_ns())
            if command is not None:
                master.send(command)
            for sample in master.velocities(LOOK_S):
                trial = trial.hear(sample)
            braked_s = (time.monotonic_ns() - (trial.broken_ns or time.monotonic_ns())) / NS_PER_S
            if braked_s > WARN_S and not warned:
                warned = True
                operator.say("IT DOES NOT STAND: use the vehicle's own switch.")
            if braked_s > GIVE_UP_S:
                break
        return trial
    finally:
        master.send(BREAK)


@contextmanager
def signalled() -> Iterator[list[int]]:
    """Note signals instead of dying of them, while the context lasts."""
    came: list[int] = []
    before = {one: signal.signal(one, lambda number, _: came.append(number)) for one in SIGNALS}
    try:
        yield came
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)


@contextmanager
def guarded(brake: Callable[[], None]) -> Iterator[None]:
    """Have another process brake when this one ends, in any way, or takes too long.

    It does so after a good end as well: one more BREAK does no harm, and no other rule is simpler.
    This program must have no other thread here: the second process would not have it.
    """
    mine, theirs = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(theirs)
        _guard(mine, brake)
    os.close(mine)
    try:
        yield
    finally:
        os.close(theirs)
        os.waitpid(child, 0)


def _guard(pipe: int, brake: Callable[[], None]) -> None:
    """Brake once the other end of the pipe is closed; the life of the second process."""
    try:
        for one in SIGNALS:  # ctrl-c reaches both, and the other one sees to it
            signal.signal(one, signal.SIG_IGN)
        select.select([pipe], [], [], GUARD_S)
        for _ in range(LAST_BREAKS):
            brake()
            time.sleep(LAST_S)
    finally:
        os._exit(0)
