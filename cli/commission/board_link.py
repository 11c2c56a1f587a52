"""``t2 checkout watchdog``: the wheels turn without the stack, and the commands end.

Nothing supervises this motion but this module: no safety, no guard. So it never commands more than
``SPEED``, writes no output while wheels turn (a stopped terminal would hold it up), and sends BRAKE
on each way out.
"""

import select
import signal
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from statistics import mean
from typing import Any

from msgspec import Struct

from cli.commission.motion import too_fast
from cli.commission.report import Report
from cli.commission.steps import confirm, show
from cli.commission.texts import ENGLISH, Say
from cli.commission.watchdog import Point, Try, judge_watchdog, silent_try, slowed_s
from cli.inspect.session import services
from cli.settings import Everything
from common import clock
from common.bus.inspector import inspecting
from common.errors import WireError
from common.freshness import NS_PER_S
from common.motion import STANDING_MPS, Twist
from common.wire import framing
from common.wire.commands import DistanceQuery, MotionCommand, MotionKind
from common.wire.frame import Frame
from common.wire.framing import Received
from common.wire.reports import (
    FROM_BOARD,
    BumperReport,
    DistanceReport,
    DriverReport,
    VelocityReport,
)
from services.bridge.core.core import QUERIES, TICK_S
from services.bridge.core.polling import Polling
from services.bridge.core.ports import Ports
from services.bridge.core.translate import MM, Translator
from services.bridge.udp import BRAKE_ATTEMPTS, Sockets
from t2.errors import LinkError, T2Error

SPEED = 0.1  # m/s
RUN, STOP, BRAKE = (
    framing.pack(MotionCommand(kind, round(speed * MM)))
    for kind, speed in ((MotionKind.RUN, SPEED), (MotionKind.STOP, 0.0), (MotionKind.BREAK, 0.0))
)
TICK_NS = round(TICK_S * NS_PER_S)
COMMAND_TICKS = 2  # 25 Hz; queries follow at the bridge's rates, up to 50 Hz
BRAKES = 5  # on each way out, a tick apart
REST_S = 2.0  # until the wheels stand
ANSWER_S = 0.1
ANSWERS = 5  # queries of the counters at most, after a silence
LOST_S = 0.5  # without velocities or counters nothing can be measured
RECENT = 10  # velocities whose mean counts
FAILOVER_S = 0.1  # from one port to the other
TURN = 0.5  # of the commanded speed: less does not count as turning
ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
STOP_STACK = "stop it with Ctrl-C in `t2 up`, or `sudo systemctl stop t2.target`"


class Times(Struct, frozen=True):
    """Durations of the tries, s."""

    turning: float = 2.0  # before the commands end
    fed: tuple[float, ...] = (5.0, 5.0, 5.0)  # longest waits while queries go on
    silent: tuple[float, ...] = (1.0, 2.0, 4.0)  # without any frame


def measure_watchdog(report: Report, config: Everything, times: Times) -> None:
    """Measure with the operator's consent, and add the verdict to the report.

    Raise ``T2Error`` when nothing can be measured; the wheels are braked then, too.
    """
    say = Say(report.language)
    report.planned, report.left_out = [say("watchdog.title")], [say("watchdog.alone")]
    show(say("watchdog.warning", speed=SPEED))
    if not confirm(say("off_ground"), "off_ground", say):
        raise T2Error(say("drive.not_confirmed"))
    longest_s = sum(times.fed) + sum(times.silent) + 3 * (len(times.fed) + len(times.silent))
    show(say("watchdog.turning", seconds=longest_s))
    with board_link(config, say) as link:
        fed = [link.attempt(times.turning, wait_s, fed=True) for wait_s in times.fed]
        silent = [link.attempt(times.turning, wait_s, fed=False) for wait_s in times.silent]
    found = judge_watchdog(fed, silent, say)
    report.steps.append((say("watchdog.title"), found))
    for name, value in found.data:
        show(f"  {name}: {value}")


def check_alone(config: Everything) -> None:
    """Raise ``T2Error`` if a bridge runs for this robot, or a relay is between PC and board."""
    if config.board.relay_port:
        raise T2Error(
            "board.relay_port is set: the relay brakes by itself, which would look like a "
            "watchdog of the board; connect the board without it, and --set board.relay_port=0"
        )
    with ExitStack() as opened:
        try:
            inspector = opened.enter_context(inspecting(config.bus))
        except LinkError:
            inspector = None  # no router: no bridge that it could list
        if inspector and services(inspector, config.robot.id, "bridge"):
            raise T2Error(f"a bridge runs for robot {config.robot.id}: {STOP_STACK}")
    try:
        Sockets(config.board).close()
    except LinkError as error:
        raise T2Error(f"{error}; if a bridge has it, {STOP_STACK}") from None


@contextmanager
def board_link(config: Everything, say: Say = ENGLISH) -> Iterator["BoardLink"]:
    """Open the link for the context; BRAKE is sent on each way out.

    A signal raises nothing where it arrives, because that may be on the way out: it ends the link
    within a tick.
    """
    with closing(BoardLink(config, say)) as link:
        ends = dict.fromkeys(ENDING, lambda *_: link.end())
        with _handling({**ends, signal.SIGTSTP: signal.SIG_IGN}):  # Ctrl-Z: the wheels would turn
            try:
                yield link
            finally:
                link.brake()
    link.check()  # a signal during BRAKE


@contextmanager
def _handling(handlers: Mapping[signal.Signals, Any]) -> Iterator[None]:
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class BoardLink:
    """The board, without the stack between: frames out, velocities and counters in."""

    def __init__(self, config: Everything, say: Say = ENGLISH) -> None:
        """Bind the bridge's ports; raise ``LinkError`` if another program has them."""
        self.config, self._say = config, say
        self._sockets = Sockets(config.board)
        self._translator = Translator(config.wire, config.vehicle)
        self._polling = Polling(QUERIES, ANSWER_S, TICK_S)
        self._ports = Ports(len(config.board.listen_ports), round(FAILOVER_S * NS_PER_S), 0)
        self._velocities: list[tuple[int, float]] = []  # receive time, m/s without its sign
        self._distance = 0.0  # m, counted
        self._counted_ns = 0
        self._commanded_ns = 0
        self._ticks = self._tick_ns = 0
        self._has_ended = False

    def end(self) -> None:
        """End the link at the next tick; a signal handler may call this."""
        self._has_ended = True

    def check(self) -> None:
        """Raise ``KeyboardInterrupt`` after ``end``."""
        if self._has_ended:
            raise KeyboardInterrupt

    def close(self) -> None:
        """Close the sockets."""
        self._sockets.close()

    def brake(self) -> None:
        """Send BRAKE several times, from each port."""
        for _ in range(BRAKES):
            for port in range(len(self._sockets.sockets)):
                self._sockets.send(BRAKE, port, BRAKE_ATTEMPTS)
            time.sleep(TICK_S)

    def attempt(self, turning_s: float, wait_s: float, *, fed: bool) -> Try:
        """Turn the wheels, end the commands, and wait for their stop; then brake.

        Raise ``T2Error`` if the wheels do not turn, or do not stop on BRAKE.
        """
        self._begin()
        self.run(turning_s, RUN)
        self._check_answers()
        last_ns, speed, start_m = self._commanded_ns, self._mean(), self._distance
        if speed < TURN * SPEED:
            about = {"measured": speed, "seconds": turning_s, "speed": SPEED}
            raise T2Error(self._say("board.not_turning", **about))
        left_s = wait_s - (clock.now_ns() - last_ns) / NS_PER_S
        port = self._ports.to_ask(clock.now_ns())
        self.run(
            left_s, queries=fed, until=lambda: fed and self._slowed_s(last_ns, speed) is not None
        )
        if fed:
            self._check_answers()
            slowed = self._slowed_s(last_ns, speed)
            result = Try(
                fed=True, waited=wait_s, slowed=slowed, travelled=abs(self._distance - start_m)
            )
        else:
            travelled = abs(self._ask_counters(port) - start_m)
            result = silent_try(self._since(last_ns), speed, wait_s, travelled)
        self._end()
        return result

    def _slowed_s(self, last_ns: int, speed: float) -> float | None:
        points = self._since(last_ns)
        return slowed_s(points, speed) if points else None

    def _since(self, last_ns: int) -> list[Point]:
        """Return the velocities since a time."""
        since = (each for each in self._velocities if each[0] > last_ns)
        return [((at_ns - last_ns) / NS_PER_S, v) for at_ns, v in since]

    def run(
        self,
        seconds: float,
        command: bytes | None = None,
        *,
        queries: bool = True,
        until: Callable[[], bool] = lambda: False,
    ) -> bool:
        """Speak to the board for a time, or until something is true; return whether it is."""
        end_ns = clock.now_ns() + round(seconds * NS_PER_S)
        while not (is_so := until()) and (now_ns := clock.now_ns()) < end_ns:
            self.check()
            if now_ns >= self._tick_ns:
                self._tick_ns = max(self._tick_ns + TICK_NS, now_ns + TICK_NS // 2)
                self._tick(now_ns, command, queries=queries)
            self._receive(min(self._tick_ns, end_ns))
        return is_so

    def _tick(self, now_ns: int, command: bytes | None, *, queries: bool) -> None:
        self._ticks += 1
        for frame in self._polling.due(now_ns) if queries else ():
            self._sockets.send(framing.pack(frame), self._ports.to_ask(now_ns))
        if command is not None and self._ticks % COMMAND_TICKS == 0:
            self._sockets.send(command, self._ports.main)
            self._commanded_ns = now_ns

    def _receive(self, until_ns: int) -> None:
        """Process what arrives until then; raise ``T2Error`` for what ends the measurement."""
        wait_s = max(0.0, (until_ns - clock.now_ns()) / NS_PER_S)
        if not select.select(self._sockets.sockets, (), (), wait_s)[0]:
            return
        for port, datagram, read_ns in self._sockets.read(*range(len(self._sockets.sockets))):
            for part in framing.read(datagram, FROM_BOARD):
                if isinstance(part, Received) and self._ports.takes(
                    type(part.frame), port, read_ns
                ):
                    self._take(part.frame, read_ns)

    def _take(self, frame: Frame, now_ns: int) -> None:
        match frame:
            case VelocityReport():
                try:
                    velocity = self._translator.velocity(frame)
                except WireError:
                    return
                self._velocities.append((now_ns, abs(velocity.linear)))
                if too_fast(Twist(SPEED), velocity):
                    raise T2Error(self._say("board.fast", measured=velocity.linear))
            case DistanceReport():
                self._distance, self._counted_ns = frame.distance_mm / MM, now_ns
            case BumperReport(on=True):
                raise T2Error(self._say("board.bumper"))
            case DriverReport(side=side, fault_bits=bits) if bits:
                driver = {"side": side.name.lower(), "bits": f"{bits:#x}"}
                raise T2Error(self._say("board.driver", **driver))

    def _begin(self) -> None:
        """Wait until velocities and counters arrive, and the wheels stand."""
        self._velocities.clear()
        if not self.run(REST_S, until=self._stands):
            self._check_answers()
            raise T2Error(self._say("board.not_standing"))

    def _end(self) -> None:
        """Stop the wheels by STOP, and BRAKE in any case."""
        self.run(REST_S, STOP, until=self._stands)
        self.brake()
        if not self.run(REST_S, BRAKE, until=self._stands):
            raise T2Error(self._say("board.not_stopping"))

    def _ask_counters(self, port: int) -> float:
        """Ask for the counted distance (m), once unless the answer is lost."""
        asked_ns = clock.now_ns()
        for _ in range(ANSWERS):
            self._sockets.send(framing.pack(DistanceQuery()), port)
            if self.run(ANSWER_S, queries=False, until=lambda: self._counted_ns > asked_ns):
                break
        else:
            raise T2Error(self._say("board.silent_counters"))
        return self._distance

    def _check_answers(self) -> None:
        """Raise ``LinkError`` unless velocities and counters arrive."""
        board = f"{self.config.board.address}:{self.config.board.port}"
        since_ns = clock.now_ns() - round(LOST_S * NS_PER_S)
        if not self._velocities or self._velocities[-1][0] < since_ns:
            raise LinkError(self._say("board.no_velocity", board=board))
        if self._counted_ns < since_ns:
            raise LinkError(self._say("board.no_counters", board=board))

    def _stands(self) -> bool:
        since_ns = clock.now_ns() - round(LOST_S * NS_PER_S)
        is_known = len(self._velocities) >= RECENT and self._velocities[-1][0] > since_ns
        return is_known and self._counted_ns > since_ns and self._mean() < STANDING_MPS

    def _mean(self) -> float:
        """Return the mean of the newest velocities, m/s."""
        return mean(v for _, v in self._velocities[-RECENT:])
