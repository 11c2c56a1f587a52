"""The relay's image between two virtual cables, with a read-only root.

PC and board are plain UDP sockets in network namespaces.
"""

import os
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from services.relay.wire import BRAKE, BUMPER, MOTION, frame
from verification.harness.network_hosts import End, connect, hosts, in_network, ip
from verification.harness.waiting import wait_until
from verification.system.frame import ROOT, Container, attempt, booted, debian, run

PC, BOARD = (f"t2image{os.getpid()}{end}" for end in "pb")
CABLES = (("eth0", BOARD, "10.7.5.224"), ("eth1", PC, "10.7.6.2"))  # the relay's end, host, address
TO_BOARD_SIDE, TO_PC_SIDE = ("10.7.5.220", 4002), ("10.7.6.1", 4002)
STOP, RUN = frame(MOTION, bytes(5)), frame(MOTION, bytes([1, 100, 0, 0, 0]))
CLEAR = frame(BUMPER, b"\0")
UNIT = "t2-relay.service"


@dataclass
class Relay:
    """The relay's computer, and the sockets at the other ends of its cables."""

    machine: Container
    board: socket.socket
    pc: socket.socket

    def wait_for_brake(self) -> None:
        """Wait until it brakes, from now on."""
        drain(self.board)
        wait_until(lambda: BRAKE in drain(self.board), "BRAKE at the board")


@contextmanager
def started() -> Iterator[Relay]:
    """Make a Debian into a relay, as docs/relay.md says, boot it, and connect its cables."""
    name = f"t2-relay-{os.getpid()}"
    recipe = ("sh", "/src/deploy/relay/image.sh", "/")
    try:
        run("docker", "run", "--name", name, f"--volume={ROOT}:/src:ro", debian(), *recipe)
        run("docker", "commit", name, name)
        with hosts(PC, BOARD), booted(name, "--read-only") as machine:
            for device, host, address in CABLES:
                connect(End(host, "cable", (address,)), End(machine.pid(), device))
            yield Relay(machine, *(udp(host, address) for _, host, address in CABLES))
    finally:
        attempt("docker", "rm", name)
        attempt("docker", "image", "rm", name)


def udp(host: str, address: str) -> socket.socket:
    """Return a socket of a host at port 4002."""

    def bound() -> socket.socket:
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sock.bind((address, 4002))
        sock.setblocking(False)
        return sock

    return in_network(f"/run/netns/{host}", bound)


def drain(sock: socket.socket) -> list[bytes]:
    """Return the datagrams that wait."""
    found = []
    with suppress(BlockingIOError):
        while True:
            found.append(sock.recv(2048))
    return found


# --- the checks -----------------------------------------------------------------------------------


def boots_and_passes(relay: Relay) -> str:
    """After the boot it brakes; RUN passes after STOP, samples and reports reach the PC."""
    relay.wait_for_brake()

    def passes() -> bool:
        relay.pc.sendto(STOP, TO_PC_SIDE)
        relay.pc.sendto(RUN, TO_PC_SIDE)
        time.sleep(0.02)
        return RUN in drain(relay.board)

    wait_until(passes, "RUN at the board")
    relay.board.sendto(CLEAR, TO_BOARD_SIDE)
    wait_until(lambda: CLEAR in drain(relay.pc), "a sample at the PC")
    wait_until(lambda: any(b'"version"' in each for each in drain(relay.pc)), "a report at the PC")
    return relay.machine.run("python3", "--version")


def cable_returns(relay: Relay) -> str:
    """After a cut of the board's cable the interface has its address, and it brakes."""
    for state in ("down", "up"):
        ip("-n", BOARD, "link", "set", "cable", state)
        time.sleep(1)
    relay.wait_for_brake()
    address = relay.machine.run("ip", "-brief", "address", "show", "eth0")
    assert "10.7.5.220/24" in address, address
    return " ".join(address.split())


def killed_returns(relay: Relay) -> str:
    """Killed, it is restarted and brakes."""
    before = relay.machine.unit(UNIT)["MainPID"]
    relay.machine.run("systemctl", "kill", "--signal=KILL", UNIT)
    relay.wait_for_brake()
    assert relay.machine.unit(UNIT)["MainPID"] != before
    return "restarted, and brakes"


CHECKS = (boots_and_passes, cable_returns, killed_returns)
