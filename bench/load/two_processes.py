"""``python -m bench.load.two_processes PORT BOARD``: two processes without T2.

The process at the board sends the bridge's queries at the same rates and reads every frame with its
CRC. Each frame goes as MessagePack through a socket to the second process. That one stores the
newest and sends a motion 50 times a second, which the first one turns into a frame.
"""

import os
import select
import socket
import struct
import sys
import time
from collections.abc import Callable, Mapping
from typing import Any

import msgpack

from bench.load.frames import REPORTS, Kinds, framed, motion, read
from common import clock

RUN, SPEED_MMPS = 1, 300
MOTION_S = 0.02
MOTION = msgpack.packb({"kind": RUN, "linear": SPEED_MMPS, "angular": 0})
KINDS: Kinds = {
    **REPORTS,
    0x7600: (struct.Struct("<ii"), lambda *counted: counted),
    0x7603: (struct.Struct("<B"), lambda *on: on),
    0x7604: (struct.Struct("<B"), lambda *on: on),
    0x7605: (struct.Struct("<BI"), lambda *faults: faults),
}
# Queries with their rates in Hz.
QUERIES = {
    framed(0x7602, b""): 50.0,
    framed(0x7600, b""): 25.0,
    framed(0x7601, b""): 20.0,
    framed(0x7605, b"\0"): 2.0,
    framed(0x7605, b"\1"): 2.0,
}


class BoardProcess:
    """The process at the board; ``send`` passes a message to the other process."""

    def __init__(self, port: int, board: int, send: Callable[[bytes], object]) -> None:
        self._sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._sock.bind(("127.0.0.1", port))
        self._board = ("127.0.0.1", board)
        self._send = send
        self._due_s = dict.fromkeys(QUERIES, time.monotonic())

    def run(self, others: Mapping[socket.socket, Callable[[], object]] = {}) -> None:
        """Run until killed; call back for other sockets that become readable."""
        calls = {self._sock: self._report, **others}
        while True:
            wait_s = max(0.0, min(self._due_s.values()) - time.monotonic())
            for ready in select.select(list(calls), [], [], wait_s)[0]:
                calls[ready]()
            self._send_queries()

    def _report(self) -> None:
        datagram, source = self._sock.recvfrom(2048)
        if source != self._board:
            return
        kind = int.from_bytes(datagram[4:6], "little")  # this board sends one frame per datagram
        for values in read(datagram, KINDS):
            message = {"kind": kind, "values": values, "mono_ns": clock.now_ns()}
            self._send(msgpack.packb(message))

    def send_frame(self, raw: bytes) -> None:
        """Send the frame of a motion."""
        motion_message = msgpack.unpackb(raw)
        values = tuple(motion_message[name] for name in ("kind", "linear", "angular"))
        self._sock.sendto(motion(values), self._board)

    def _send_queries(self) -> None:
        now_s = time.monotonic()
        for query, due_s in self._due_s.items():
            if due_s <= now_s:
                self._sock.sendto(query, self._board)
                self._due_s[query] = due_s + 1 / QUERIES[query]


def decide(gate: socket.socket) -> None:
    """Store the newest of each kind and send motions, until the other process ends."""
    newest: dict[int, Any] = {}
    due_s = time.monotonic()
    while True:
        if select.select([gate], [], [], max(0.0, due_s - time.monotonic()))[0]:
            raw = gate.recv(2048)
            if not raw:
                return  # the other process has ended
            message = msgpack.unpackb(raw)
            newest[message["kind"]] = message["values"]
        if due_s <= time.monotonic():
            gate.send(MOTION)
            due_s += MOTION_S


def main() -> None:
    """Run both processes."""
    port, board = map(int, sys.argv[1:])
    here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    if os.fork():
        there.close()
        gate = BoardProcess(port, board, here.send)
        gate.run({here: lambda: gate.send_frame(here.recv(2048))})
    else:
        here.close()
        decide(there)


if __name__ == "__main__":
    main()
