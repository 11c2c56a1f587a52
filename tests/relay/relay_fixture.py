"""A copy of the relay as a process on a machine without T2, with plain sockets on both sides."""

import json
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from services import relay
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until

PC, PC_SIDE, BOARD_SIDE, BOARD, STRANGER = (f"127.77.0.{number}" for number in range(1, 6))


class RunningRelay:
    """The relay's process; ``pc`` has two sockets and ``board`` one."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        shutil.copytree(Path(relay.__file__).parent, folder / "relay")
        self.ports = [free_port(socket.SOCK_DGRAM) for _ in range(2)]
        self.board_port, self.report_port = (free_port(socket.SOCK_DGRAM) for _ in range(2))
        self.pc = [stack.enter_context(udp(PC, port)) for port in self.ports]
        self.board = stack.enter_context(udp(BOARD, self.board_port))
        self.log = folder / "log"
        self._folder = folder
        self.process = self.start()

    def command(self) -> list[str]:
        """Return the command, without site packages and environment."""
        # docs/relay.md: the tests with the oldest Python that the relay runs on.
        python = os.environ.get("T2_RELAY_PYTHON", sys.executable)
        return [
            python, "-S", "-E", "-s", "-m", "relay", "--pc", PC, "--pc-side", PC_SIDE,
            "--board", BOARD, "--board-side", BOARD_SIDE, "--board-port", str(self.board_port),
            "--ports", *map(str, self.ports), "--report-port", str(self.report_port),
        ]  # fmt: skip

    def start(self, *words: str) -> "subprocess.Popen[bytes]":
        """Start a relay, with further words."""
        command = [*self.command(), *words]
        with self.log.open("ab") as log:
            return subprocess.Popen(command, cwd=self._folder, stderr=log)

    def to_board(self, datagram: bytes, port: int = 0) -> None:
        """Send from the PC."""
        self.pc[port].sendto(datagram, (PC_SIDE, self.board_port))

    def to_pc(self, datagram: bytes, port: int = 0) -> None:
        """Send from the board."""
        self.board.sendto(datagram, (BOARD_SIDE, self.ports[port]))

    def reports(self) -> list[dict[str, Any]]:
        """Return the reports that wait at the PC; other datagrams are dropped."""
        source = PC_SIDE, self.report_port
        return [json.loads(datagram) for datagram, sender in drain(self.pc[0]) if sender == source]

    def wait_for(self, braking: str) -> dict[str, Any]:
        """Wait for a report with this state."""

        def found() -> list[dict[str, Any]]:
            return [report for report in self.reports() if report["braking"] == braking]

        return wait_until(found, f"a report: {braking!r}")[-1]


def udp(address: str, port: int = 0) -> socket.socket:
    """Return a bound socket that does not block."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.setblocking(False)
    sock.bind((address, port))
    return sock


def drain(sock: socket.socket) -> list[tuple[bytes, tuple[str, int]]]:
    """Return the waiting datagrams with their senders."""
    found = []
    while True:
        try:
            found.append(sock.recvfrom(4096))
        except BlockingIOError:
            return found
        except OSError:
            continue  # nobody listens at the other end yet


def wait_for(sock: socket.socket, datagram: bytes) -> tuple[str, int]:
    """Wait until a datagram arrives; return its sender."""

    def found() -> list[tuple[str, int]]:
        return [sender for each, sender in drain(sock) if each == datagram]

    return wait_until(found, f"{datagram.hex()} at {sock.getsockname()}")[-1]


def received(sock: socket.socket, seconds: float) -> list[bytes]:
    """Return everything that arrives within a time."""
    time.sleep(seconds)
    return [datagram for datagram, _ in drain(sock)]


@contextmanager
def running_relay(folder: Path) -> Iterator[RunningRelay]:
    """Run a relay between a PC and a board."""
    with ExitStack() as stack:
        it = RunningRelay(folder, stack)
        try:
            yield it
        finally:
            it.process.kill()
            it.process.wait()
