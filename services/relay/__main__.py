"""``python3 -m relay``: pass datagrams between PC and board; brake without commands of the PC."""

import argparse
import os
import select
import signal
import socket
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from ipaddress import IPv4Address
from typing import NoReturn

from .core import BOARD, PC, REPORT, Relay, Send
from .udp import Endpoint

EXIT_LINK, EXIT_CONFIG = 69, 78  # as the services of T2
TICK_MS = 5
OPEN_PERIOD_NS = 200_000_000  # an address may appear later, with its cable
PRIORITY = 50


class Shell:
    """Sockets, clock and log around the core."""

    def __init__(self, options: argparse.Namespace) -> None:
        ports: list[int] = options.ports
        self._core = core = Relay(time.monotonic_ns(), len(ports))
        ours, pc = (str(options.pc_side), options.board_port), str(options.pc)
        board_side, board = str(options.board_side), (str(options.board), options.board_port)
        count = core.counters
        self._endpoints = {
            BOARD: [Endpoint((board_side, port), board, count, False) for port in ports],
            PC: [Endpoint(ours, (pc, port), count, True) for port in ports],
            REPORT: [Endpoint((ours[0], options.report_port), (pc, ports[0]), count, False)],
        }
        self._closed = [each for group in self._endpoints.values() for each in group]
        self._opened_ns = 0
        self._poll = select.poll()
        self._logged = ""

    def run(self) -> NoReturn:
        """Pass datagrams until ``KeyboardInterrupt``; the last frame is BRAKE, on an error too."""
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        try:
            self._open(time.monotonic_ns())
            notify("READY=1")
            while True:
                self._poll.poll(TICK_MS)
                self._round()
        finally:
            self._do(self._core.brake(time.monotonic_ns()))

    def _round(self) -> None:
        """Read the PC first: a flood of the board must not delay the lease."""
        core = self._core
        for port, endpoint in enumerate(self._endpoints[PC]):
            for datagram in endpoint.read():
                self._do(core.from_pc(datagram, port, endpoint.empty_ns, time.monotonic_ns()))
        now_ns = time.monotonic_ns()
        self._do(core.tick(now_ns))
        for port, endpoint in enumerate(self._endpoints[BOARD]):
            for datagram in endpoint.read():
                self._do(core.from_board(datagram, port, time.monotonic_ns()))
        if self._closed and now_ns - self._opened_ns > OPEN_PERIOD_NS:
            self._open(now_ns)
        if core.braking != self._logged:
            self._logged = core.braking
            log(f"braking: {core.braking}" if core.braking else "passing")

    def _do(self, sends: Sequence[Send]) -> None:
        for to, port, datagram in sends:
            self._endpoints[to][port].send(datagram)
            if to == REPORT:
                notify("WATCHDOG=1")

    def _open(self, now_ns: int) -> None:
        self._opened_ns = now_ns
        for endpoint in [*self._closed]:
            before = endpoint.problem
            if endpoint.open():
                self._closed.remove(endpoint)
                if endpoint not in self._endpoints[REPORT]:
                    self._poll.register(endpoint.sock, select.POLLIN)
            elif endpoint.problem != before:
                log(f"waiting for {endpoint.problem}")


def log(text: str) -> None:
    """Write a line to standard error; a reader that hangs does not stop the relay."""
    with suppress(OSError):
        os.write(2, f"relay: {text}\n".encode())


def notify(state: str) -> None:
    """Report to systemd, if it started the relay."""
    if path := os.environ.get("NOTIFY_SOCKET", "").replace("@", "\0", 1):
        with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sock:
            sock.sendto(state.encode(), socket.MSG_DONTWAIT, path)


def main(words: Sequence[str]) -> int:
    """Run until a signal; return the exit code."""
    parser = argparse.ArgumentParser(prog="relay", description=__doc__)
    add = parser.add_argument
    add("--board", type=IPv4Address, default="10.7.5.224", help="the board's address")
    add("--board-side", type=IPv4Address, default="10.7.5.220", help="our address to the board")
    add("--pc-side", type=IPv4Address, default="10.7.6.1", help="our address to the PC")
    add("--pc", type=IPv4Address, default="10.7.6.2", help="the PC's address")
    add("--board-port", type=int, default=4002, help="of the board, and ours to the PC")
    add(
        "--ports",
        type=int,
        nargs="+",
        default=[4002, 4001],
        help="of the PC, and ours to the board",
    )
    add("--report-port", type=int, default=4010, help="that our reports come from")
    try:
        shell = Shell(parser.parse_args(words))
    except SystemExit as end:
        return EXIT_CONFIG if end.code else 0
    with suppress(OSError):
        os.set_blocking(2, False)
    with suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    try:
        shell.run()
    except (OSError, OverflowError) as error:
        log(f"cannot use a UDP port: {error}; is another relay running?")
        return EXIT_LINK
    except KeyboardInterrupt:
        return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
