"""Independent main board: UDP, a simple vehicle, and faults that a scenario switches on."""

import contextlib
import random
import select
import socket
import struct
import threading
import time
from collections import Counter
from dataclasses import dataclass, field

from verification.outside import wire

VELOCITY_S, STEP_S = 0.02, 0.005
NO_ECHO_MM = 20_000
BOTH = (0, 1)


@dataclass
class Faults:
    """Faults of the board; all may change while it runs."""

    drop_every: int = 0  # every n-th answer is lost
    drop_bumper: int = 0  # every n-th answer about the bumper is lost
    drop: tuple[int, ...] = ()  # answers of these ids are lost
    answer_ports: tuple[int, ...] = BOTH  # of the host's two ports, where answers go
    velocity_ports: tuple[int, ...] = BOTH
    hit_ports: tuple[int, ...] = BOTH  # where a pressed bumper is reported; the others say clear
    switch_echo: bool = True
    keeps_rolling: bool = False  # nothing but BRAKE takes speed away
    drift: tuple[float, float] | None = None  # m/s and rad/s while STOP holds
    dither: bool = False  # counters go forth and back by one step, velocities are a little off
    bias: tuple[float, float] = (0.0, 0.0)  # m/s and rad/s that the velocity is off
    silent: bool = False  # nothing is sent, nothing is received


@dataclass
class Vehicle:
    """A vehicle that follows the last command; no watchdog on the board."""

    linear: float = 0.0
    angular: float = 0.0
    distance: float = 0.0
    heading: float = 0.0
    travelled: float = 0.0  # m, either way
    acceleration: float = 1.2
    deceleration: float = 0.8  # on STOP
    brake: float = 5.0
    angular_ratio: float = 2.5  # angular limits by the linear ones

    def follow(self, command: wire.Command, faults: Faults, step: float) -> None:
        """Advance by a step."""
        slower = abs(command.linear) + abs(command.angular) < abs(self.linear) + abs(self.angular)
        if command.kind == "brake":
            self._approach(0.0, 0.0, self.brake * step)
        elif faults.keeps_rolling and (slower or command.kind == "stop"):
            pass
        elif command.kind == "run":
            self._approach(command.linear, command.angular, self.acceleration * step)
        elif faults.drift is not None:
            self.linear, self.angular = faults.drift
        else:
            self._approach(0.0, 0.0, self.deceleration * step)
        self.distance += self.linear * step
        self.travelled += abs(self.linear) * step
        self.heading += self.angular * step

    def _approach(self, linear: float, angular: float, most: float) -> None:
        self.linear += max(-most, min(most, linear - self.linear))
        most *= self.angular_ratio
        self.angular += max(-most, min(most, angular - self.angular))


@dataclass
class Board:
    """The board on 127.0.0.1 and its log of received frames."""

    port: int
    host_ports: tuple[int, int]
    faults: Faults = field(default_factory=Faults)
    vehicle: Vehicle = field(default_factory=Vehicle)

    def __post_init__(self) -> None:
        self.bumper = 0  # the byte that is reported
        self.sonars = [NO_ECHO_MM] * 8
        self.commands: list[wire.Command] = []
        self.received: list[tuple[float, int, bytes]] = []  # time, id, payload
        self.reported: list[tuple[float, float]] = []  # velocities to report next, instead of true
        self.answered: Counter[int] = Counter()
        self.brakes = {wire.SONAR_BRAKE: False, wire.BUMPER_BRAKE: False}
        self._counts: Counter[int] = Counter()  # of answers, by id; 0 for all
        self._command = wire.Command(0.0, "stop", 0.0, 0.0)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", self.port))
        self._socket.setblocking(False)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        self._ended.set()
        self._thread.join()
        self._socket.close()

    def restart(self, dark: float) -> None:
        """Restart after a time without power: counters, emergency brakes and command are reset."""
        self.faults.silent = True
        time.sleep(dark)
        self._command = wire.Command(0.0, "stop", 0.0, 0.0)
        self.vehicle = Vehicle()
        self.brakes = dict.fromkeys(self.brakes, False)
        self.faults.silent = False

    def since(self, at: float) -> list[wire.Command]:
        """Return the motion commands since a time."""
        return [command for command in list(self.commands) if command.at >= at]

    def queries(self, command: int, since: float) -> int:
        """Return how many frames of an id came since a time."""
        return sum(at >= since and name == command for at, name, _ in list(self.received))

    def _run(self) -> None:
        due = step_at = time.monotonic()
        while not self._ended.is_set():
            now = time.monotonic()
            if now >= due:
                due = max(due + VELOCITY_S, now)
                self._report_velocity()
            readable, _, _ = select.select([self._socket], [], [], STEP_S)
            self._receive() if readable else None
            now = time.monotonic()
            self.vehicle.follow(self._command, self.faults, now - step_at)
            step_at = now

    def _report_velocity(self) -> None:
        off = self.faults.bias
        true = self.vehicle.linear + off[0], self.vehicle.angular + off[1]
        if self.faults.dither:
            true = random.uniform(-0.03, 0.03), random.uniform(-0.03, 0.03)
        velocity = self.reported.pop(0) if self.reported else true
        for index in self.faults.velocity_ports:
            self._send(wire.velocity(*velocity), index)

    def _receive(self) -> None:
        with contextlib.suppress(BlockingIOError, ConnectionRefusedError):
            while True:
                datagram, _ = self._socket.recvfrom(2048)
                if self.faults.silent:
                    continue
                now = time.monotonic()
                for command, payload in wire.frames(datagram):
                    self.received.append((now, command, payload))
                    self._execute(command, payload, now)

    def _execute(self, command: int, payload: bytes, now: float) -> None:
        if command == wire.MOTION:
            self._command = wire.motion(payload, now)
            self.commands.append(self._command)
            return
        if command in self.brakes:
            self.brakes[command] = bool(payload[0])
            if not self.faults.switch_echo:
                return
        if self._is_lost(command):
            return
        for index in self.faults.answer_ports:
            self._send(wire.frame(command, self._answer(command, payload, index)), index)
        self.answered[command] += 1

    def _is_lost(self, command: int) -> bool:
        """Count an answer; return whether it is one of those that are lost."""
        if command in self.faults.drop:
            return True
        self._counts.update((0, command))
        every = ((0, self.faults.drop_every), (wire.BUMPER, self.faults.drop_bumper))
        return any(each in (0, command) and n and self._counts[each] % n == 0 for each, n in every)

    def _answer(self, command: int, payload: bytes, index: int) -> bytes:
        if command == wire.DISTANCE:
            step = random.randint(0, 1) if self.faults.dither else 0
            distance, heading = self.vehicle.distance, self.vehicle.heading
            return wire.distance(distance + step * 0.001, heading + step * 0.00175)[8:]
        if command == wire.SONAR:
            return struct.pack("<8H", *self.sonars)
        if command == wire.BUMPER:
            return bytes([self.bumper if index in self.faults.hit_ports else 0])
        if command == wire.DRIVER:
            return payload + bytes(4)
        return bytes([0x55]) if command == wire.LED else payload

    def _send(self, datagram: bytes, index: int) -> None:
        if not self.faults.silent:
            with contextlib.suppress(OSError):
                self._socket.sendto(datagram, ("127.0.0.1", self.host_ports[index]))
