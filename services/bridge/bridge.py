"""``python -m services.bridge.bridge``: the bridge process, started by ``services.bridge.guard``.

The shell of the core: sockets, bus, clock and the guard's pipe. It carries out the outputs of the
core one by one, so that BRAKE leaves before anything else of its datagram is processed.
"""

import os
import signal
import sys
from bisect import bisect_left
from collections import deque
from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any

from msgspec.structs import replace

from common import clock, realtime
from common.bus.bus import Arrival, Caller
from common.bus.publisher import Publisher
from common.freshness import NS_PER_S
from common.motion import BRAKE
from common.service import Node, run
from services.bridge.config import BridgeConfig
from services.bridge.core.core import TICK_S, Core
from services.bridge.core.output import Event, Output, Publish, Reacted, Refuse, Reply, Send
from services.bridge.guard import BRAKES_ENV, DESCRIPTORS_ENV, Pulse
from services.bridge.udp import BRAKE_ATTEMPTS, Sockets
from t2 import keys
from t2 import messages as m

MOTIONS = 8  # queue length
LATE_NS = round(1.5 * TICK_S * NS_PER_S)  # of a tick after a stall
REMIND_S = 10  # between two warnings of a board that has not sent yet
ECHOES = 64  # queued safety states; a call that echoes a dropped one is refused
# Bounds of the histograms: 10 us to 1 s, four a decade.
BOUNDS_NS = tuple(round(10_000 * 10 ** (step / 4)) for step in range(21))


def main() -> int:
    """Run the bridge until a signal, or until its guard has died."""
    if DESCRIPTORS_ENV not in os.environ:
        print("bridge: start it by `python -m services.bridge`", file=sys.stderr)  # noqa: T201
        return 2
    # Supervisors send these to guard and bridge alike. The guard passes on SIGHUP, and its death by
    # SIGQUIT stops the vehicle.
    for number in (signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)
    *sockets, pipe = map(int, os.environ[DESCRIPTORS_ENV].split(","))
    # The guard needs the higher priority: it brakes for this process.
    ahead = realtime.BRIDGE if realtime.priority(os.getppid()) > realtime.BRIDGE else 0
    braked = os.environ.get(BRAKES_ENV) == "1"
    build = partial(Bridge, sockets=sockets, pipe=pipe, braked=braked)
    return run("bridge", BridgeConfig, build, priority=ahead)


class Histogram:
    """Histogram of durations, for the health message."""

    def __init__(self) -> None:
        self._counts = [0] * (len(BOUNDS_NS) + 1)
        self._worst_ns = 0

    def add(self, duration_ns: int) -> None:
        """Add a duration."""
        self._counts[bisect_left(BOUNDS_NS, duration_ns)] += 1
        self._worst_ns = max(self._worst_ns, duration_ns)

    def message(self) -> m.Durations:
        """Return the published form."""
        bounds = tuple(bound / NS_PER_S for bound in BOUNDS_NS)
        worst = self._worst_ns / NS_PER_S
        return m.Durations(bounds=bounds, counts=tuple(self._counts), worst=worst)


class Bridge:
    """Passes inputs to the core and carries out its outputs."""

    def __init__(
        self,
        node: Node[BridgeConfig],
        sockets: Sequence[int] = (),
        pipe: int | None = None,
        *,
        braked: bool = False,
    ) -> None:
        """Set up with the descriptors of a guard, and whether the bridge before held BRAKE."""
        self._node = node
        drive = node.open_drive(listens=True)  # safety accepts samples only from this link
        self._sockets = Sockets(node.config.board, sockets)
        self._pulse = None if pipe is None else Pulse(pipe, self._on_no_guard)
        self._reactions = {"reflex": Histogram(), "judged_stop": Histogram()}
        self._core = Core(node.config, node.bus.boot, node.counters, clock.now_ns())
        self._ticked_ns = clock.now_ns()
        self._unheard_s = 0  # without a first frame of the board
        self._braking = False  # as the guard knows
        self._unsent = False  # whether the system did not send the last order, a BRAKE
        self._events = deque[Event]()
        self._publishers: dict[str, Publisher[Any]] = {
            "velocity": drive.publisher(keys.VELOCITY),
            "mileage": drive.publisher(keys.MILEAGE),
            "ultrasonic": drive.publisher(keys.ULTRASONIC),
            "bumper": drive.publisher(keys.BUMPER),
            "driver_left": drive.publisher(keys.DRIVER, side="left"),
            "driver_right": drive.publisher(keys.DRIVER, side="right"),
            "link": drive.publisher(keys.LINK),
            "switches": drive.publisher(keys.SWITCHES),
        }
        self._core.motions.lease = replace(self._core.motions.lease, braked=braked)
        self._send(self._core.motions.order(BRAKE))  # as the guard did last
        drive.subscribe(keys.MOTION, self._on_motion, depth=MOTIONS)
        node.bus.subscribe(keys.SAFETY, self._on_safety, depth=ECHOES, post=node.loop.defer)
        # Safety receives it, too, unless it hangs, restarts or is cut off.
        estop_key = keys.estop_key(node.config.robot.id)
        node.bus.on_any(
            estop_key, lambda received_ns: self._do(self._core.motions.on_estop(received_ns))
        )
        node.bus.serve(keys.SET_SWITCHES, self._on_switches)
        node.bus.serve(keys.SET_LED, self._on_led)
        self._begin()

    def _begin(self) -> None:
        loop = self._node.loop
        for port, sock in enumerate(self._sockets.sockets):
            loop.watch(sock, partial(self._on_readable, port))
        loop.every(TICK_S, self._on_tick)
        loop.every(1.0, self._on_second)
        self._node.reactions = lambda: {n: one.message() for n, one in self._reactions.items()}
        self._node.is_stopped = self._is_stopped
        self._node.on_exit = self._on_exit

    # --- in -----------------------------------------------------------------------------------

    def _on_readable(self, port: int, _: int) -> None:
        self._read(port)

    def _read(self, *ports: int) -> None:
        """Process the datagrams waiting in the sockets of these ports."""
        # The port of the commands first: after a stall both ports have datagrams, and the other one
        # must not take over only because it is read first.
        first = self._core.motions.port
        for port, datagram, read_ns in self._sockets.read(first, *ports):
            self._do(self._core.datagram(datagram, port, read_ns))

    def _on_motion(self, arrival: Arrival[m.Motion]) -> None:
        motion, received_ns = arrival.message, arrival.received_ns
        self._do(self._core.motions.on_motion(motion, received_ns, clock.now_ns()))

    def _on_safety(self, arrival: Arrival[m.SafetyState]) -> None:
        self._core.calls.on_safety(arrival.message, arrival.received_ns)

    def _on_switches(self, request: m.SwitchesRequest, caller: Caller[m.Switches]) -> None:
        self._do(self._core.calls.on_switches(request, caller, clock.now_ns()))

    def _on_led(self, request: m.LedRequest, caller: Caller[m.Done]) -> None:
        self._do(self._core.calls.on_led(request, caller, clock.now_ns()))

    def _on_tick(self, now_ns: int) -> None:
        if now_ns - self._ticked_ns > LATE_NS:
            # Read the sockets first: after a stall of this loop, queued datagrams are not yet
            # counted, and the board would seem silent.
            self._read(*range(len(self._sockets.sockets)))
        self._ticked_ns = now_ns
        if report := self._sockets.take_relay_report():
            self._core.relay_report(report, now_ns)
        if self._unsent:
            self._send(self._core.motions.order(BRAKE))
        self._do(self._core.tick(now_ns))
        self._beat()
        self._report()

    def _on_second(self, _: int) -> None:
        sockets, counters, rejected = self._sockets, self._node.counters, self._core.rejected
        if sockets.refused > rejected["wrong_address"]:
            text = "datagrams from another address are dropped; see board.any_source_port"
            self._node.log.warning(text, source=str(sockets.last_foreign_source))
        if sockets.send_errors > counters["send_errors"]:
            text = "the system refuses to send to the board"
            self._node.log.warning(text, count=sockets.send_errors, error=sockets.last_error)
        self._unheard_s = self._unheard_s + 1 if self._core.readiness.link == "never" else 0
        if self._unheard_s % REMIND_S == REMIND_S // 2:
            board = self._node.config.board
            text = f"no frame from {board.address}:{board.port} yet; run `t2 doctor`"
            self._node.log.warning(text, listening=f"{board.listen_address} {board.listen_ports}")
        rejected["wrong_address"] = sockets.refused
        counters["send_errors"] = sockets.send_errors
        self._do(self._core.second())

    # --- out ----------------------------------------------------------------------------------

    def _do(self, outputs: Iterable[Output]) -> None:
        """Carry out what the core yields."""
        for output in outputs:
            match output:
                case Send():
                    self._send(output)
                case Publish(stream, message, raw):
                    self._publishers[stream].put(message, raw)
                case Event():
                    self._events.append(output)
                case Reply(caller, reply):
                    caller.reply(reply)
                case Refuse(caller, reasons):
                    caller.refuse(*reasons)
                case Reacted(name, since_ns):
                    self._reactions[name].add(clock.now_ns() - since_ns)

    def _report(self) -> None:
        """Publish and log the events; they wait for a tick, and delay no command and no sample."""
        while self._events:
            event = self._events.popleft()
            self._node.event(event.name, event.level, *event.phrases, **event.about)

    def _send(self, send: Send) -> None:
        """Send; a BRAKE that the system refuses is sent again, at once and at each tick."""
        is_brake = send.order is BRAKE
        sent = self._sockets.send(send.datagram, send.port, BRAKE_ATTEMPTS if is_brake else 1)
        if send.order is not None:
            self._unsent = is_brake and not sent
            if self._core.motions.lease.braking is not self._braking:
                self._beat()  # the guard learns of it at once

    def _beat(self) -> None:
        if self._pulse is not None:
            motions = self._core.motions
            self._braking = motions.lease.braking
            self._pulse.beat(motions.port, brakes=self._braking)

    # --- the end ------------------------------------------------------------------------------

    def _on_no_guard(self) -> None:
        # Both are restarted together: a bridge without a guard must not drive.
        self._node.event("guard_gone", "error")
        self._node.loop.stop()

    def _is_stopped(self) -> bool:
        """Stop the vehicle; return True at standstill, or after one second."""
        now_ns = clock.now_ns()
        self._do(self._core.motions.stop(now_ns))
        return self._core.motions.is_stopped(now_ns)

    def _on_exit(self) -> None:
        self._send(self._core.motions.on_exit(clock.now_ns()))
        if self._pulse is not None:
            self._pulse.end()
        self._report()


if __name__ == "__main__":
    sys.exit(main())
