"""Test of the board's own command watchdog, with the stack down and this tool as the only master.

The bridge never stops sending, so it cannot show what the board does when commands end. The test
uses the bridge's ports instead, which also proves that no bridge runs. Three measures ensure that
RUN is never the last command:

- every way out of the test sends BRAKE, signals and bugs of this program included;
- a second process holds the same sockets, and sends BRAKE when this one dies or hangs;
- the board's own emergency brakes are switched on first, and must be confirmed.
"""

import os
import select
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from cli.commission.operator import Step, confirm, show
from cli.commission.report import Verdict, judged
from cli.commission.watchdog_plan import BRAKE, Sample, WatchdogPlan, judge_watchdog
from cli.settings import Everything
from common import clock
from common.errors import WireError
from common.freshness import NS_PER_S, Latest
from common.motion import Twist
from common.wire import commands, reports
from common.wire.frame import Frame
from common.wire.framing import Framing, Received
from services.bridge.core.translate import Translator
from services.bridge.udp import Sockets

POLL_S = 0.005
STANDSTILL_S = 3.0
ECHO_S = 2.0
REPEAT_S = 0.1
WARN_S, GIVE_UP_S = 3.0, 10.0  # of BRAKE without standstill; the board keeps the last command
GUARD_S = 3.0  # RUN and silence of the test take 2 s
LAST_BRAKES, LAST_S = 10, 0.05
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
PHRASE = "wheels off the ground"
WHAT = "The stack must be down, all wheels off the ground, a hand on the vehicle's switch."


class BoardMaster:
    """The board's only master, on the bridge's UDP ports."""

    def __init__(self, config: Everything) -> None:
        """Bind the ports; raise ``LinkError`` if a bridge has them."""
        self._sockets = Sockets(config.board)
        self._framing = Framing(config.wire.crc, config.wire.crc_covers)
        limits = config.bridge.max_linear, config.bridge.max_angular
        self._translator = Translator(config.wire, config.vehicle, *limits)
        self._port = 0
        self.rejected = 0

    def close(self) -> None:
        """Release the ports."""
        self._sockets.close()

    def send(self, frame: Frame) -> None:
        """Send from the port that received last."""
        self._sockets.send(self._framing.pack(frame), self._port)

    def listen(self, seconds: float) -> Iterator[Frame]:
        """Wait for frames of the board, at most for a time, and yield them."""
        select.select(self._sockets.sockets, [], [], seconds)
        for port, datagram, _ in self._sockets.read(self._port):
            for part in self._framing.read(datagram, reports.FROM_BOARD):
                if isinstance(part, Received):
                    self._port = port
                    yield part.frame
                else:
                    self.rejected += 1

    def velocities(self, seconds: float) -> Iterator[Sample]:
        """Wait for frames likewise, and yield the velocities."""
        for frame in self.listen(seconds):
            if isinstance(frame, reports.VelocityReport):
                try:
                    velocity = self._translator.velocity(frame)
                except WireError:
                    continue  # implausible: the header has no CRC
                twist = Twist(velocity.linear, velocity.angular)
                yield Latest(twist, clock.now_ns())

    def wait_for_standstill(self) -> str:
        """Brake until the board reports standstill; return the problem, or an empty string."""
        end_s = time.monotonic() + STANDSTILL_S
        while time.monotonic() < end_s:
            self.send(BRAKE)
            for sample in self.velocities(REPEAT_S):
                if sample.value.is_standing:
                    return ""
        bad = f"; {self.rejected} invalid frames" if self.rejected else ""
        return f"The board does not report standstill within {STANDSTILL_S:g} s{bad}."

    def switch_brakes_on(self) -> str:
        """Switch the board's emergency brakes on; return the problem, or an empty string."""
        kinds = (reports.UltrasonicBrakeReport, reports.BumperBrakeReport)
        echoed: set[type[Frame]] = set()
        end_s = time.monotonic() + ECHO_S
        while len(echoed) < len(kinds) and time.monotonic() < end_s:
            self.send(commands.UltrasonicBrakeSet(True))
            self.send(commands.BumperBrakeSet(True))
            for frame in self.listen(REPEAT_S):
                if isinstance(frame, kinds) and frame.on:
                    echoed.add(type(frame))
        missing = [kind.__name__ for kind in kinds if kind not in echoed]
        return f"The board did not send: {', '.join(missing)}." if missing else ""


def watchdog(master: BoardMaster) -> Verdict:
    """Run the test after the operator's confirmation."""
    fact = "The stack is down. The wheels will turn, for a second of it without any command."
    if not confirm(fact, PHRASE):
        return judged(["Not confirmed: no motion was commanded."], "")
    if problem := master.wait_for_standstill() or master.switch_brakes_on():
        return judged([problem], "")
    show("The wheels turn. Ctrl-C stops them.")
    with braking_guard(lambda: master.send(BRAKE)), signalled() as signals:
        plan = _execute(master, signals)
    verdict = judge_watchdog(plan)
    if plan.phase != "over":
        return judged([verdict.text, "NO STANDSTILL after BRAKE."], "", verdict.data)
    return verdict


def _execute(master: BoardMaster, signals: list[int]) -> WatchdogPlan:
    plan = WatchdogPlan(clock.now_ns())
    warned = False
    try:
        while plan.phase != "over":
            if signals:
                plan = plan.end("Ctrl-C", clock.now_ns())
            plan, command = plan.tick(clock.now_ns())
            if command is not None:
                master.send(command)
            for sample in master.velocities(POLL_S):
                plan = plan.add(sample)
            braked_s = (clock.now_ns() - (plan.braked_ns or clock.now_ns())) / NS_PER_S
            if braked_s > WARN_S and not warned:
                warned = True
                show("NO STANDSTILL: use the vehicle's own switch.")
            if braked_s > GIVE_UP_S:
                break
        return plan
    finally:
        master.send(BRAKE)


@contextmanager
def signalled() -> Iterator[list[int]]:
    """Record signals during the context instead of ending the process."""
    received: list[int] = []
    before = {one: signal.signal(one, lambda number, _: received.append(number)) for one in SIGNALS}
    try:
        yield received
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)


@contextmanager
def braking_guard(brake: Callable[[], None]) -> Iterator[None]:
    """Fork a process that brakes when this one ends in any way, or takes too long.

    It also brakes after a regular end: one more BRAKE does no harm, and the rule stays simple.
    This process must have a single thread here, because a fork copies only one.
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
    """Brake when the other end of the pipe is closed; main function of the second process."""
    try:
        for one in SIGNALS:  # Ctrl-C reaches both processes; the first one handles it
            signal.signal(one, signal.SIG_IGN)
        select.select([pipe], [], [], GUARD_S)
        for _ in range(LAST_BRAKES):
            brake()
            time.sleep(LAST_S)
    finally:
        os._exit(0)


WATCHDOG = Step("watchdog", "The board's own watchdog", WHAT, watchdog)
