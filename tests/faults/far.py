"""``python -m tests.faults.far ENDPOINT``: a driver in a network of its own, behind a bad cable.

This process holds both ends of the cable between two networks, a TUN device in each, and does to
the packets what it is told. Reads lines from standard input: speeds, which it hands on to its
driver, and ``sim.requests.Wire`` as JSON, where ``to_pc`` is the way to the robot.
"""

import ctypes
import fcntl
import os
import select
import struct
import subprocess
import sys
import time

import msgspec

from common.freshness import S
from sim.faults import Cable, Datagram
from sim.requests import Wire

TUNSETIFF = 0x400454CA  # linux/if_tun.h
IFF_TUN, IFF_NO_PI = 0x0001, 0x1000
CLONE_NEWNET = 0x40000000
PACKET_MAX = 2048
IDLE_S = 0.1


def main() -> None:
    """Forward packets until standard input ends."""
    port = int(sys.argv[1].rpartition(":")[2])
    net = f"10.{port >> 8}.{port & 255}"  # one for each router
    near = _end(f"near{port}", f"{net}.1")
    if ctypes.CDLL(None, use_errno=True).unshare(CLONE_NEWNET):
        raise OSError(ctypes.get_errno(), "no network of its own")
    far = _end(f"far{port}", f"{net}.2")
    driver = [sys.executable, "-m", "tests.faults.driver", f"tcp/{net}.1:{port}"]
    with subprocess.Popen(driver, stdin=subprocess.PIPE) as process:
        assert process.stdin is not None
        try:
            _forward(near, far, process.stdin.fileno())
        finally:
            process.kill()


def _end(name: str, address: str) -> int:
    """Make one end of the cable in the network that this process is in."""
    device = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(device, TUNSETIFF, struct.pack("16sH", name.encode(), IFF_TUN | IFF_NO_PI))
    for words in (("addr", "add", f"{address}/24", "dev", name), ("link", "set", name, "up")):
        subprocess.run(["ip", *words], check=True)
    return device


def _forward(near: int, far: int, driver: int) -> None:
    to_far, to_near = Cable(1), Cable(2)
    ways = ((near, to_far, far), (far, to_near, near))
    said = b""
    while True:
        select.select([near, far, sys.stdin.fileno()], [], [], _wait_s(to_far, to_near))
        now_ns = time.monotonic_ns()
        for source, cable, sink in ways:
            for packet in _waiting(source):
                cable.put(Datagram(packet, 0), now_ns)
            for datagram in cable.take(now_ns):
                os.write(sink, datagram.payload)
        if select.select([sys.stdin], [], [], 0)[0]:
            new = os.read(sys.stdin.fileno(), PACKET_MAX)
            if not new:
                return
            *lines, said = (said + new).split(b"\n")
            for line in lines:
                _obey(line, to_far, to_near, driver)


def _obey(line: bytes, to_far: Cable, to_near: Cable, driver: int) -> None:
    if not line.startswith(b"{"):
        os.write(driver, line + b"\n")
        return
    faults = msgspec.json.decode(line, type=Wire)
    if faults.direction in ("to_pc", "both"):
        to_near.faults = faults
    if faults.direction in ("to_board", "both"):
        to_far.faults = faults


def _wait_s(*cables: Cable) -> float:
    due = [cable.due_ns for cable in cables if cable.due_ns is not None]
    return max(0.0, (min(due) - time.monotonic_ns()) / S) if due else IDLE_S


def _waiting(device: int) -> list[bytes]:
    packets = []
    while True:
        try:
            packets.append(os.read(device, PACKET_MAX))
        except BlockingIOError:
            return packets


if __name__ == "__main__":
    main()
