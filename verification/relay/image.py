"""``python -m verification.relay.image``: make the relay's image, boot it, pull a cable.

``deploy/relay/image.sh`` makes a Debian root with debootstrap. It boots in a container whose two
interfaces are virtual cables to a PC and a board, plain UDP sockets in network namespaces. The root
is read-only.
"""

import contextlib
import ctypes
import json
import os
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

from services.relay.wire import BRAKE, BUMPER, MOTION, frame
from verification.harness.network_hosts import ip, missing
from verification.harness.waiting import wait_until
from verification.systemd.machine import Machine, booted, import_root, lacking

ROOT = Path(__file__).parents[2]
IMAGE = "t2-relay-test"
PC, BOARD = (f"t2image{os.getpid()}{end}" for end in "pb")
CABLES = (("eth0", BOARD, "10.7.5.224"), ("eth1", PC, "10.7.6.2"))  # the relay's end, host, address
STOP, RUN = frame(MOTION, bytes(5)), frame(MOTION, bytes([1, 100, 0, 0, 0]))
CLEAR, HIT = frame(BUMPER, b"\0"), frame(BUMPER, b"\1")
LEASE_S = 0.2
SETNS = ctypes.CDLL(None, use_errno=True).setns  # os.setns is Python 3.12


class Ends:
    """The sockets of PC and board."""

    def __init__(self) -> None:
        self.pc = udp(PC, "10.7.6.2")
        self.board = udp(BOARD, "10.7.5.224")

    def command(self, datagram: bytes) -> None:
        """Send a datagram of the PC."""
        self.pc.sendto(datagram, ("10.7.6.1", 4002))

    def sample(self, datagram: bytes) -> None:
        """Send a datagram of the board."""
        self.board.sendto(datagram, ("10.7.5.220", 4002))

    def drive(self) -> None:
        """Send RUN until it passes; a STOP before it."""

        def passes() -> bool:
            self.command(STOP)
            self.command(RUN)
            time.sleep(0.02)
            return RUN in drain(self.board)

        wait_until(passes, "RUN at the board")


def boots(machine: Machine, ends: Ends) -> str:
    """After the boot the unit runs, and brakes."""
    wait_until(lambda: BRAKE in drain(ends.board), "BRAKE at the board")
    unit = machine.unit("t2-relay.service")
    assert unit["ActiveState"] == "active", unit
    return machine.run("python3", "--version").strip()


def passes_both_ways(_machine: Machine, ends: Ends) -> str:
    """Commands pass after a neutral one, samples and reports reach the PC."""
    ends.drive()
    ends.sample(CLEAR)
    seen: list[bytes] = []

    def complete() -> bool:
        ends.command(RUN)
        seen.extend(drain(ends.pc))
        return CLEAR in seen and any(each.startswith(b"{") for each in seen)

    wait_until(complete, "a sample and a report at the PC")
    report = json.loads(next(each for each in seen if each.startswith(b"{")))
    return f"report {report['version']}"


def silence_brakes(_machine: Machine, ends: Ends) -> str:
    """Without commands it brakes, and RUN does not pass."""
    ends.drive()
    drain(ends.board)
    began_s = time.monotonic()
    wait_until(lambda: BRAKE in drain(ends.board), "BRAKE at the board")
    took_s = time.monotonic() - began_s
    assert took_s < 2 * LEASE_S, took_s
    ends.command(RUN)
    time.sleep(2 * LEASE_S)
    assert set(drain(ends.board)) == {BRAKE}
    return f"after {took_s:.2f} s"


def hit_brakes(_machine: Machine, ends: Ends) -> str:
    """It brakes on a hit by itself."""
    for _ in range(3):
        ends.sample(CLEAR)
    ends.drive()
    drain(ends.board)
    ends.sample(HIT)
    for _ in range(20):  # commands go on: their silence is not what brakes
        ends.command(RUN)
        time.sleep(LEASE_S / 20)
    found = drain(ends.board)
    assert BRAKE in found
    assert RUN not in found[found.index(BRAKE) :]
    return "while commands go on"


def cable_returns(machine: Machine, ends: Ends) -> str:
    """After a cut of the board's cable the interface has its address, and it brakes."""
    for state in ("down", "up"):
        ip("-n", BOARD, "link", "set", "cable", state)
        time.sleep(1)
    drain(ends.board)
    wait_until(lambda: BRAKE in drain(ends.board), "BRAKE at the board")
    address = machine.run("ip", "-brief", "address", "show", "eth0")
    assert "10.7.5.220/24" in address, address
    return " ".join(address.split())


def killed_returns(machine: Machine, ends: Ends) -> str:
    """Killed, it is restarted and brakes."""
    before = machine.unit("t2-relay.service")["MainPID"]
    machine.run("systemctl", "kill", "--signal=KILL", "t2-relay.service")
    drain(ends.board)
    began_s = time.monotonic()
    wait_until(lambda: BRAKE in drain(ends.board), "BRAKE at the board")
    took_s = time.monotonic() - began_s
    assert machine.unit("t2-relay.service")["MainPID"] != before
    return f"BRAKE after {took_s:.2f} s"


CHECKS = (boots, passes_both_ways, silence_brakes, hit_brakes, cable_returns, killed_returns)


def main() -> int:
    """Print a row for each check; return 1 when one fails."""
    if reason := lacking() or missing(PC):
        print(f"did not run: {reason}")
        return 0
    make_image()
    with booted(IMAGE, "--read-only") as machine, cables(machine.pid()):
        ends = Ends()
        for check in CHECKS:
            try:
                seen, code = check(machine, ends), 0
            except (AssertionError, subprocess.SubprocessError) as error:
                seen, code = f"FAILED: {error}", 1
            print(f"{check.__name__:18} {seen}", flush=True)
            if code:
                print(machine.attempt("journalctl", "-o", "cat", "-n", "60").stdout)
                return code
    return 0


def make_image() -> None:
    """Make the root of this computer's architecture, as docs/relay.md says."""
    words = ["dpkg", "--print-architecture"]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "root"
        print("making the image with debootstrap", flush=True)
        subprocess.run(
            ["sh", ROOT / "deploy" / "relay" / "image.sh", root, done.stdout.strip()],
            check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        import_root(root, IMAGE)


@contextlib.contextmanager
def cables(pid: str) -> Iterator[None]:
    """Connect PC and board to the computer of a process."""
    try:
        for device, host, address in CABLES:
            ip("netns", "add", host)
            peer = ("type", "veth", "peer", "name", device, "netns", pid)
            ip("link", "add", "cable", "netns", host, *peer)
            ip("-n", host, "address", "add", f"{address}/24", "dev", "cable")
            ip("-n", host, "link", "set", "cable", "up")
        yield
    finally:
        for _, host, _ in CABLES:
            ip("netns", "del", host, check=False)


def udp(host: str, address: str) -> socket.socket:
    """Return a socket of a host at port 4002."""
    made: list[socket.socket] = []

    def make() -> None:
        with Path(f"/run/netns/{host}").open("rb") as namespace:
            if SETNS(namespace.fileno(), 0):
                raise OSError(ctypes.get_errno(), f"setns {host}")
        made.append(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))

    # The namespace is changed for the thread only; a socket stays in the one it was made in.
    maker = threading.Thread(target=make)
    maker.start()
    maker.join()
    made[0].bind((address, 4002))
    made[0].setblocking(False)
    return made[0]


def drain(sock: socket.socket) -> list[bytes]:
    """Return what waits."""
    found = []
    with contextlib.suppress(BlockingIOError):
        while True:
            found.append(sock.recv(2048))
    return found


if __name__ == "__main__":
    sys.exit(main())
