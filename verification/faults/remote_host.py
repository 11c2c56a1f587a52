"""A program on a simulated remote host behind a disturbed network link.

``python -m verification.faults.remote_host ENDPOINT MODULE [WORD]...``

The host has its own network namespace, monotonic clock and boot id. ``MODULE`` runs there, with the
router's endpoint as seen from there and the words. This process forwards packets between two TUN
devices, one in each network, and disturbs them. It reads lines from standard input:
``sim.requests.Wire`` as JSON, where ``to_pc`` is the direction to the robot, and ``Address``. It
passes all other lines on to the program.
"""

import contextlib
import ctypes
import fcntl
import os
import select
import signal
import struct
import subprocess
import sys
import tempfile
import uuid
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from common import clock
from common.bus.publisher import BOOT_ID
from common.freshness import NS_PER_S
from sim.faults import Cable, Datagram
from sim.requests import Wire
from verification.harness.network_hosts import (
    CLONE_NEWNET,
    CLONE_NEWNS,
    CLONE_NEWTIME,
    ip,
    keep_mounts,
    unshare,
)

TUNSETIFF = 0x400454CA  # linux/if_tun.h
IFF_TUN, IFF_NO_PI = 0x0001, 0x1000
PR_SET_PDEATHSIG = 1  # linux/prctl.h
PACKET_MAX = 2048
IDLE_S = 0.1
AHEAD_S = 86_400  # of the remote host's clocks since boot: it booted a day earlier
# Loss-based: a new network namespace has no cubic.
CONGESTION = Path("/proc/sys/net/ipv4/tcp_congestion_control")
OFFSETS = Path("/proc/self/timens_offsets")


class Address(msgspec.Struct, frozen=True, tag_field="do", tag="address"):
    """Change the remote host's address; the last of its four numbers."""

    last: int


@dataclass
class Link:
    """The link between two hosts, and the program's input."""

    near: int
    far: int
    net: str
    program: int
    to_far: Cable = field(default_factory=lambda: Cable(1))
    to_near: Cable = field(default_factory=lambda: Cable(2))

    def forward(self) -> None:
        """Forward packets until standard input ends."""
        with open(0, "rb", buffering=0) as stdin:
            while True:
                ends = [self.near, self.far, stdin.fileno()]
                ready, _, _ = select.select(ends, [], [], self._wait_s())
                self._forward(self.near, self.to_far, self.far)
                self._forward(self.far, self.to_near, self.near)
                if stdin.fileno() in ready:
                    line = stdin.readline()
                    if not line:
                        return
                    self._execute(line)

    def _forward(self, source: int, cable: Cable, sink: int) -> None:
        now_ns = clock.now_ns()
        with contextlib.suppress(BlockingIOError):  # no more packets
            while True:
                cable.put(Datagram(os.read(source, PACKET_MAX), 0), now_ns)
        for datagram in cable.take(now_ns):
            os.write(sink, datagram.payload)

    def _execute(self, line: bytes) -> None:
        if not line.startswith(b"{"):
            os.write(self.program, line)
            return
        what = msgspec.json.decode(line, type=Wire | Address)
        if isinstance(what, Address):
            ip("addr", "flush", "dev", "far")
            ip("addr", "add", f"{self.net}.{what.last}/24", "dev", "far")
            return
        if what.direction in ("to_pc", "both"):
            self.to_near.faults = what
        if what.direction in ("to_board", "both"):
            self.to_far.faults = what

    def _wait_s(self) -> float:
        due = [cable.due_ns for cable in (self.to_far, self.to_near) if cable.due_ns is not None]
        return max(0.0, (min(due) - clock.now_ns()) / NS_PER_S) if due else IDLE_S


def net(port: int) -> str:
    """Return the network between a router and its remote host, one for each port."""
    return f"10.{port >> 8}.{port & 255}"


def main() -> None:
    """Run the remote host until standard input ends."""
    endpoint, module, *words = sys.argv[1:]
    protocol, port = endpoint.partition("/")[0], int(endpoint.rpartition(":")[2])
    CONGESTION.write_text("reno\n")
    near = _end(f"near{port}", f"{net(port)}.1")
    _enter_namespaces()
    far = _end("far", f"{net(port)}.2")
    ip("link", "set", "lo", "up")
    command = [sys.executable, "-m", module, f"{protocol}/{net(port)}.1:{port}", *words]
    with subprocess.Popen(command, stdin=subprocess.PIPE, preexec_fn=die_with_parent) as process:
        assert process.stdin is not None
        try:
            Link(near, far, net(port), process.stdin.fileno()).forward()
        finally:
            process.kill()


def die_with_parent() -> None:
    """Make the kernel kill this process when its parent ends."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def _enter_namespaces() -> None:
    """Enter the namespaces of the remote host; its clock applies to children only."""
    timed = CLONE_NEWTIME if OFFSETS.exists() else 0  # older kernels have one clock for all
    unshare(CLONE_NEWNS | CLONE_NEWNET | timed)
    CONGESTION.write_text("reno\n")
    if timed:
        OFFSETS.write_text(f"monotonic {AHEAD_S} 0\nboottime {AHEAD_S} 0\n")
    keep_mounts()
    with tempfile.NamedTemporaryFile() as boot:
        Path(boot.name).write_text(f"{uuid.uuid4()}\n")
        subprocess.run(["mount", "--bind", boot.name, str(BOOT_ID)], check=True)


def _end(name: str, address: str) -> int:
    """Create one end of the link in the current network namespace."""
    device = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(device, TUNSETIFF, struct.pack("16sH", name.encode(), IFF_TUN | IFF_NO_PI))
    ip("addr", "add", f"{address}/24", "dev", name)
    ip("link", "set", name, "up")
    return device


if __name__ == "__main__":
    main()
