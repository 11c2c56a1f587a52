"""Independent main board, written from the manual and the notes on its wire alone.

``python -m verification.faults.independent_board PORT HOST_PORT HOST_PORT TRACE``

It imports only the standard library: an error in T2's codec or simulator cannot hide here. It takes
the simulator's place in a stack: it writes the motion commands that it receives to a trace, and
lines on its standard input change it:

- ``press BYTE PORT``: report this bumper byte at one of the host's ports, 0 or 1
- ``wall METRES``: an obstacle ahead; the front sonar measures it, and contact presses the bumper
- ``roll SPEED``: roll at this speed while STOP is commanded
- ``normal``: none of these

Frame, little-endian: "GS", size, id, CRC-16/ARC of the payload, payload. Speeds are sign and
magnitude in mm/s and 0.1 deg/s; counters are two's complement in mm and 0.1 deg.
"""

import json
import math
import select
import socket
import struct
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

MOTION, COUNTERS, SONARS, BUMPER, DRIVER = 0x7426, 0x7600, 0x7601, 0x7602, 0x7605
KINDS = ("stop", "run", "brake")
HEADER = struct.Struct("<2sHHH")

VELOCITY_S, STEP_S = 0.02, 0.005
NO_ECHO_MM = 20_000
FRONT = 2  # of the eight sonars
ACCELERATION, COAST, BRAKE = 1.2, 0.8, 5.0  # m/s^2
TURNING = 2.5  # rad/s^2 of turning for each m/s^2
DECIDEGREES = 1800 / math.pi  # of a radian


def crc16(data: bytes) -> int:
    """Return CRC-16/ARC: reflected 0x8005, start 0, no final XOR."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ 0xA001 if crc & 1 else crc >> 1
    return crc


def frame(command: int, payload: bytes) -> bytes:
    """Return a frame."""
    return HEADER.pack(b"GS", HEADER.size + len(payload), command, crc16(payload)) + payload


def frames(datagram: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield id and payload of the valid frames at the start of a datagram."""
    while len(datagram) >= HEADER.size:
        magic, size, command, crc = HEADER.unpack_from(datagram)
        payload = datagram[HEADER.size : size]
        if magic != b"GS" or HEADER.size + len(payload) != size or crc16(payload) != crc:
            return
        yield command, payload
        datagram = datagram[size:]


def signed(value: int) -> int:
    """Return the number of a sign and magnitude."""
    return -(value & 0x7FFF) if value & 0x8000 else value


def magnitude(value: float) -> int:
    """Return the sign and magnitude of a number."""
    size = round(abs(value))
    return size | 0x8000 if value < 0 and size else size


class IndependentBoard:
    """Board and vehicle on 127.0.0.1."""

    def __init__(self, port: int, host_ports: tuple[int, int], trace: TextIO) -> None:
        self.linear = self.angular = self.distance = self.heading = 0.0
        self.normal()
        self._command = ("stop", 0.0, 0.0)  # kind, m/s, rad/s
        self._host_ports, self._trace = host_ports, trace
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", port))
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End."""
        self._ended.set()
        self._thread.join()
        self._socket.close()

    def normal(self) -> None:
        """Free the bumper, remove the wall, hold the vehicle by STOP."""
        self._bumper = [0, 0]  # by port of the host
        self._wall_m = math.inf  # where the way ahead ends
        self._rolls = 0.0  # m/s while STOP is commanded

    def press(self, byte: str, port: str) -> None:
        """Report a bumper byte at one port."""
        self._bumper[int(port)] = int(byte)

    def wall(self, metres: str) -> None:
        """Place an obstacle ahead."""
        self._wall_m = self.distance + float(metres)

    def roll(self, speed: str) -> None:
        """Roll while STOP is commanded."""
        self._rolls = float(speed)

    def _run(self) -> None:
        report_s = step_s = time.monotonic()
        while not self._ended.is_set():
            readable, _, _ = select.select([self._socket], [], [], STEP_S)
            now_s = time.monotonic()
            if readable:
                datagram, (_, port) = self._socket.recvfrom(2048)
                self._receive(datagram, port)
            self._move(now_s - step_s)
            step_s = now_s
            if now_s >= report_s:
                report_s = max(report_s + VELOCITY_S, now_s)
                speeds = magnitude(self.linear * 1000), magnitude(self.angular * DECIDEGREES)
                for index in (0, 1):
                    self._send(frame(MOTION, struct.pack("<HH", *speeds)), index)

    def _receive(self, datagram: bytes, port: int) -> None:
        if port not in self._host_ports:
            return
        for command, payload in frames(datagram):
            if command == MOTION:
                kind, linear, angular = struct.unpack("<BHH", payload)
                self._command = KINDS[kind], signed(linear) / 1000, signed(angular) / DECIDEGREES
                self._record(*self._command)
                continue
            for index in (0, 1):
                self._send(frame(command, self._content(command, payload, index)), index)

    def _record(self, kind: str, linear: float, angular: float) -> None:
        mono_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME)
        line = {"event": "command", "mono_ns": mono_ns, "kind": kind, "linear": linear}
        self._trace.write(json.dumps(line | {"angular": angular}) + "\n")
        self._trace.flush()

    def _content(self, command: int, payload: bytes, index: int) -> bytes:
        if command == COUNTERS:
            heading = (round(self.heading * DECIDEGREES) + 1800) % 3600 - 1800
            return struct.pack("<ii", round(self.distance * 1000), heading)
        if command == SONARS:
            return struct.pack("<8H", *self._ranges())
        if command == BUMPER:
            return bytes([self._bumper[index]])
        if command == DRIVER:
            return payload + bytes(4)
        return payload  # of a brake: its echo

    def _ranges(self) -> list[int]:
        ranges = [NO_ECHO_MM] * 8
        if math.isfinite(self._wall_m):
            ranges[FRONT] = max(1, round(1000 * (self._wall_m - self.distance)))
        return ranges

    def _send(self, content: bytes, index: int) -> None:
        self._socket.sendto(content, ("127.0.0.1", self._host_ports[index]))

    def _move(self, step_s: float) -> None:
        kind, linear, angular = self._command
        if kind == "run":
            self._approach(linear, angular, ACCELERATION * step_s)
        elif kind == "brake":
            self._approach(0.0, 0.0, BRAKE * step_s)
        else:
            self._approach(self._rolls, 0.0, COAST * step_s)
        self.distance += self.linear * step_s
        self.heading += self.angular * step_s
        if self.distance > self._wall_m:
            self.distance, self.linear = self._wall_m, 0.0
            self._bumper = [1, 1]

    def _approach(self, linear: float, angular: float, most: float) -> None:
        self.linear += max(-most, min(most, linear - self.linear))
        turn = TURNING * most
        self.angular += max(-turn, min(turn, angular - self.angular))


def main() -> None:
    """Run a board until standard input ends."""
    port, first, second = map(int, sys.argv[1:4])
    with Path(sys.argv[4]).open("w", encoding="utf-8") as trace:
        board = IndependentBoard(port, (first, second), trace)
        sys.stdout.write('{"event": "started"}\n')
        sys.stdout.flush()
        for line in sys.stdin:
            what, *values = line.split()
            getattr(board, what)(*values)
        board.close()


if __name__ == "__main__":
    main()
