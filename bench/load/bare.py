"""``python -m bench.load.bare PORT BOARD``: the same datagrams by two processes, and nothing else.

What somebody writes in an afternoon. The one at the board asks what the bridge asks, as often, and
reads every frame with its CRC; each goes as MessagePack through a socket to the other one, which
keeps the newest and answers with a motion 50 times a second, and that becomes a frame.
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
# What is asked, and how often in Hz.
QUERIES = {
    framed(0x7602, b""): 50.0,
    framed(0x7600, b""): 50.0,
    framed(0x7601, b""): 20.0,
    framed(0x7605, b"\0"): 2.0,
    framed(0x7605, b"\1"): 2.0,
}


class Gate:
    """The process at the board; ``tell`` gives the other one a message."""

    def __init__(self, port: int, board: int, tell: Callable[[bytes], object]) -> None:
        self._sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._sock.bind(("127.0.0.1", port))
        self._board = ("127.0.0.1", board)
        self._tell = tell
        self._due_s = dict.fromkeys(QUERIES, time.monotonic())

    def run(self, heard: Mapping[socket.socket, Callable[[], object]] = {}) -> None:
        """Stand between the board and the other one until killed, and call for what is heard."""
        calls = {self._sock: self._report, **heard}
        while True:
            wait_s = max(0.0, min(self._due_s.values()) - time.monotonic())
            for ready in select.select(list(calls), [], [], wait_s)[0]:
                calls[ready]()
            self._ask()

    def _report(self) -> None:
        datagram, source = self._sock.recvfrom(2048)
        if source != self._board:
            return
        kind = int.from_bytes(datagram[4:6], "little")  # this board sends them one by one
        for values in read(datagram, KINDS):
            message = {"kind": kind, "values": values, "mono_ns": time.monotonic_ns()}
            self._tell(msgpack.packb(message))

    def obey(self, raw: bytes) -> None:
        """Make a frame of a motion."""
        told = msgpack.unpackb(raw)
        values = told["kind"], told["linear"], told["angular"]
        self._sock.sendto(motion(values), self._board)

    def _ask(self) -> None:
        now_s = time.monotonic()
        for query, due_s in self._due_s.items():
            if due_s <= now_s:
                self._sock.sendto(query, self._board)
                self._due_s[query] = due_s + 1 / QUERIES[query]


def judge(gate: socket.socket) -> None:
    """Keep the newest of each kind, and answer by the clock, until the other one ends."""
    newest: dict[int, Any] = {}
    due_s = time.monotonic()
    while True:
        if select.select([gate], [], [], max(0.0, due_s - time.monotonic()))[0]:
            raw = gate.recv(2048)
            if not raw:
                return  # the other one has ended
            message = msgpack.unpackb(raw)
            newest[message["kind"]] = message["values"]
        if due_s <= time.monotonic():
            gate.send(MOTION)
            due_s += MOTION_S


def main() -> None:
    """Be both of them."""
    port, board = map(int, sys.argv[1:])
    here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    if os.fork():
        there.close()
        gate = Gate(port, board, here.send)
        gate.run({here: lambda: gate.obey(here.recv(2048))})
    else:
        here.close()
        judge(there)


if __name__ == "__main__":
    main()
