"""PC, relay and board as three hosts in network namespaces, with plain UDP programs."""

import contextlib
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from common import clock
from common.freshness import NS_PER_S
from services import relay
from services.relay.wire import BRAKE
from tests.relay.frames import RUN, STOP
from verification.harness.network_hosts import End, connect, ip, missing
from verification.harness.network_hosts import hosts as made
from verification.harness.waiting import wait_until

PC, RELAY, BOARD = (f"t2relay{os.getpid()}{end}" for end in ("p", "r", "b"))
WHY = missing(PC)
pytestmark = [pytest.mark.timed, pytest.mark.skipif(bool(WHY), reason=WHY or "-")]

# Sends STOP for half a second, then RUN, whatever happens to its cable.
DRIVER = f"""
import socket, time
sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
sock.bind(("10.7.6.2", 4002))
for n in range(10**6):
    try:
        sock.sendto(bytes.fromhex("{STOP.hex()}" if n < 25 else "{RUN.hex()}"), ("10.7.6.1", 4002))
    except OSError:
        pass
    time.sleep(0.02)
"""
RECEIVER = """
import socket, time
sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
sock.bind(("10.7.5.224", 4002))
while True:
    datagram, source = sock.recvfrom(2048)
    print(time.clock_gettime_ns(time.CLOCK_BOOTTIME), datagram.hex(), flush=True)
"""
FLOOD = """
import socket, time
sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
while True:
    for _ in range(20):
        for port in (4002, 4001):
            sock.sendto(bytes(24), ("10.7.5.220", port))
    time.sleep(0.001)
"""
REACTION_S = 0.5  # 0.2 s, and what a busy host adds


class Hosts:
    """Three hosts, two cables, and what the board received."""

    def __init__(self, folder: Path, stack: contextlib.ExitStack) -> None:
        self._folder, self._stack = folder, stack
        shutil.copytree(Path(relay.__file__).parent, folder / "relay")
        self.received = folder / "board"
        self.run(BOARD, "-uc", RECEIVER)
        self.relay = self.start_relay()
        self.run(PC, "-c", DRIVER)
        wait_until(lambda: self.frames() and self.frames()[-1][1] == RUN, "RUN at the board")

    def start_relay(self) -> "subprocess.Popen[bytes]":
        """Start the relay with the addresses of a vehicle."""
        return self.run(RELAY, "-S", "-E", "-s", "-m", "relay")

    def run(self, host: str, *words: str) -> "subprocess.Popen[bytes]":
        """Run Python on a host until the end of the test."""
        command = ["ip", "netns", "exec", host, sys.executable, *words]
        with self.received.open("ab") as output:
            process = subprocess.Popen(command, cwd=self._folder, stdout=output)
        self._stack.callback(process.wait)
        self._stack.callback(process.kill)
        return process

    def frames(self, since_ns: int = 0) -> list[tuple[int, bytes]]:
        """Return times and datagrams at the board."""
        text, _, _ = self.received.read_text().rpartition("\n")  # whole lines
        lines = text.splitlines()
        made = [(int(at), bytes.fromhex(datagram)) for at, datagram in map(str.split, lines)]
        return [(at_ns, datagram) for at_ns, datagram in made if at_ns >= since_ns]


@pytest.fixture
def hosts(tmp_path: Path) -> Iterator[Hosts]:
    with made(PC, RELAY, BOARD), contextlib.ExitStack() as stack:
        connect(End(PC, "cable", ("10.7.6.2",)), End(RELAY, "pc", ("10.7.6.1",)))
        connect(End(BOARD, "cable", ("10.7.5.224",)), End(RELAY, "board", ("10.7.5.220",)))
        yield Hosts(tmp_path, stack)


def remove_pc(hosts: Hosts) -> None:
    """Remove the PC with its cable."""
    ip("-n", PC, "link", "del", "cable")


def cut_pc(hosts: Hosts) -> None:
    """Cut the cable to the PC, and connect it again while the PC still sends RUN."""
    ip("-n", PC, "link", "set", "cable", "down")
    time.sleep(0.5)
    ip("-n", PC, "link", "set", "cable", "up")


def kill_pc_in_a_flood(hosts: Hosts) -> None:
    """Kill everything on the PC while the board floods the relay."""
    hosts.run(BOARD, "-c", FLOOD)
    time.sleep(0.3)
    assert hosts.frames()[-1][1] == RUN
    for pid in ip("netns", "pids", PC).stdout.split():
        os.kill(int(pid), 9)


@pytest.mark.parametrize("fault", [remove_pc, cut_pc, kill_pc_in_a_flood])
def test_the_board_ends_with_brake(hosts: Hosts, fault: Callable[[Hosts], None]) -> None:
    fault(hosts)
    at_ns = clock.now_ns()
    time.sleep(REACTION_S + 0.5)
    after = hosts.frames(at_ns + round(REACTION_S * NS_PER_S))
    assert {datagram for _, datagram in after} == {BRAKE}
    assert len(after) > 5


def test_without_the_relay_the_board_holds_its_last_run_until_it_starts_again(hosts: Hosts) -> None:
    hosts.relay.kill()
    hosts.relay.wait()
    time.sleep(0.5)
    assert hosts.frames()[-1][1] == RUN  # the residual risk of docs/relay.md
    at_ns = clock.now_ns()
    hosts.start_relay()
    wait_until(lambda: len(hosts.frames(at_ns)) > 5, "frames of the next relay")
    assert {datagram for _, datagram in hosts.frames(at_ns)} == {BRAKE}


def test_a_cable_to_the_board_that_is_cut_is_used_again(hosts: Hosts) -> None:
    ip("-n", BOARD, "link", "set", "cable", "down")
    time.sleep(0.5)
    assert hosts.frames()[-1][1] == RUN
    at_ns = clock.now_ns()
    ip("-n", BOARD, "link", "set", "cable", "up")
    wait_until(lambda: hosts.frames(at_ns), "frames after the cut")
