"""Independent main board, written from the manual and the notes on its wire alone.

It imports only the standard library: an error in T2's codec or simulator cannot hide here.

Frame, little-endian: "GS", size, id, CRC-16/ARC of the payload, payload. Speeds are sign and
magnitude in mm/s and 0.1 deg/s; counters are two's complement in mm and 0.1 deg.
"""

import math
import select
import socket
import struct
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass

MOTION, COUNTERS, SONARS, BUMPER = 0x7426, 0x7600, 0x7601, 0x7602
SONAR_BRAKE, BUMPER_BRAKE, DRIVER = 0x7603, 0x7604, 0x7605
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


@dataclass(frozen=True)
class Command:
    """A motion command, with the numbers of the wire."""

    at_s: float
    kind: str
    linear: int  # mm/s
    angular: int

    @property
    def moves(self) -> bool:
        """Whether it moves the vehicle."""
        return self.kind == "run" and (self.linear != 0 or self.angular != 0)


class IndependentBoard:
    """Board and vehicle on 127.0.0.1; its attributes may change while it runs."""

    def __init__(self, port: int, host_ports: tuple[int, int]) -> None:
        self.merge_s = 0.0  # for which frames wait for others, to share a datagram
        self.ignores_stop = False  # only BRAKE takes speed away
        self.rolls = 0.0  # m/s while STOP is commanded
        self.wall_m: float | None = None  # distance at which an obstacle ends the way ahead

        self.linear = self.angular = self.distance = self.heading = 0.0
        self.brakes = {SONAR_BRAKE: False, BUMPER_BRAKE: False}
        self.commands: list[Command] = []

        self._bumper = [0, 0]  # by port of the host
        self._command = Command(0.0, "stop", 0, 0)
        self._host_ports = host_ports
        self._off_until_s = self._flush_s = 0.0
        self._waiting = [b"", b""]
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

    def press(self, byte: int = 1, ports: tuple[int, ...] = (0, 1)) -> float:
        """Report this bumper byte on these ports from now on; return the time."""
        self._bumper = [byte if index in ports else 0 for index in (0, 1)]
        return time.monotonic()

    def restart(self, off_s: float) -> None:
        """Restart: brakes, command and counters are reset, and nothing is sent for a time."""
        self._off_until_s = time.monotonic() + off_s
        self._command = Command(0.0, "stop", 0, 0)
        self.brakes = dict.fromkeys(self.brakes, False)
        self.linear = self.angular = self.distance = self.heading = 0.0

    def since(self, at_s: float) -> list[Command]:
        """Return the motion commands since a time."""
        return [command for command in list(self.commands) if command.at_s >= at_s]

    def _run(self) -> None:
        report_s = step_s = time.monotonic()
        while not self._ended.is_set():
            readable, _, _ = select.select([self._socket], [], [], STEP_S)
            now_s = time.monotonic()
            if readable:
                datagram, (_, port) = self._socket.recvfrom(2048)
                self._receive(datagram, port, now_s)
            self._move(now_s - step_s)
            step_s = now_s
            if now_s >= report_s and now_s >= self._off_until_s:
                report_s = max(report_s + VELOCITY_S, now_s)
                self._report()
            if now_s >= self._flush_s:
                self._flush_s = now_s + self.merge_s
                self._flush()

    def _receive(self, datagram: bytes, port: int, now_s: float) -> None:
        if now_s < self._off_until_s or port not in self._host_ports:
            return
        for command, payload in frames(datagram):
            if command == MOTION:
                kind, linear, angular = struct.unpack("<BHH", payload)
                self._command = Command(now_s, KINDS[kind], signed(linear), signed(angular))
                self.commands.append(self._command)
            else:
                self._answer(command, payload)

    def _answer(self, command: int, payload: bytes) -> None:
        if command in self.brakes:
            self.brakes[command] = bool(payload[0])
        for index in (0, 1):
            self._send(frame(command, self._content(command, payload, index)), index)

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
        return payload

    def _ranges(self) -> list[int]:
        ranges = [NO_ECHO_MM] * 8
        if self.wall_m is not None:
            ranges[FRONT] = max(1, round(1000 * (self.wall_m - self.distance)))
        return ranges

    def _report(self) -> None:
        speeds = magnitude(self.linear * 1000), magnitude(self.angular * DECIDEGREES)
        for index in (0, 1):
            self._send(frame(MOTION, struct.pack("<HH", *speeds)), index)

    def _send(self, content: bytes, index: int) -> None:
        self._waiting[index] += content
        if not self.merge_s:
            self._flush()

    def _flush(self) -> None:
        for index, port in enumerate(self._host_ports):
            if self._waiting[index]:
                self._socket.sendto(self._waiting[index], ("127.0.0.1", port))
                self._waiting[index] = b""

    def _move(self, step_s: float) -> None:
        command = self._command
        if command.kind == "brake":
            self._approach(0.0, 0.0, BRAKE * step_s)
        elif command.kind == "run":
            linear, angular = command.linear / 1000, command.angular / DECIDEGREES
            self._approach(linear, angular, ACCELERATION * step_s)
        elif not self.ignores_stop:
            self._approach(self.rolls, 0.0, COAST * step_s)
        self.distance += self.linear * step_s
        self.heading += self.angular * step_s
        if self.wall_m is not None and self.distance > self.wall_m:
            self.distance, self.linear = self.wall_m, 0.0
            self.press()

    def _approach(self, linear: float, angular: float, most: float) -> None:
        self.linear += max(-most, min(most, linear - self.linear))
        turn = TURNING * most
        self.angular += max(-turn, min(turn, angular - self.angular))
