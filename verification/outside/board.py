"""Independent main board: UDP, a vehicle, sonars, and faults that a scenario switches on."""

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
from verification.outside.cable import GOOD, Cable, Packing, Port
from verification.outside.sonars import NO_ECHO_MM, Ring, before
from verification.outside.vehicle import Vehicle

VELOCITY_S, ECHO_S, STEP_S = 0.02, 0.05, 0.005
TOUCH = 0.005  # m, travel of the bumper strip
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
    noise: tuple[float, float] = (0.0, 0.0)  # m/s and rad/s, standard deviation of velocities
    counts: tuple[float, float] = (1.0, 1.0)  # distance and turn that a true unit counts
    bounce: float = 0.0  # s that the bumper's switch chatters after each change
    watchdog: float = 0.0  # s without a command until the board stops by itself; 0: never
    ports: tuple[Port, Port] = GOOD


@dataclass
class Board:
    """The board on 127.0.0.1 and its log of received frames."""

    port: int
    host_ports: tuple[int, int]
    faults: Faults = field(default_factory=Faults)
    vehicle: Vehicle = field(default_factory=Vehicle)
    ring: Ring = field(default_factory=Ring)
    packing: Packing = field(default_factory=Packing)
    command_unit: float = wire.DECIDEGREES_PER_RADIAN  # of the angular velocity, for one rad/s

    def __post_init__(self) -> None:
        self.sonars = [NO_ECHO_MM] * 8
        self.wall: float | None = None  # where an obstacle ends the vehicle's way, by its distance
        self.wall_echoes = True
        self.contacts: list[float] = []  # times at which the vehicle touched it
        self._changed = 0.0  # when that last began or ended
        self._touching = False
        self._to_host, self._to_board = Cable(), Cable()
        self._echoes = list(self.sonars)  # of the last round
        self.bumper = 0  # the byte that is reported
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
        self.vehicle = Vehicle(motors=self.vehicle.motors)
        self.brakes = dict.fromkeys(self.brakes, False)
        self.faults.silent = False

    def since(self, at: float) -> list[wire.Command]:
        """Return the motion commands since a time."""
        return [command for command in list(self.commands) if command.at >= at]

    def queries(self, command: int, since: float) -> int:
        """Return how many frames of an id came since a time."""
        return sum(at >= since and name == command for at, name, _ in list(self.received))

    def _run(self) -> None:
        due = echo_due = step_at = time.monotonic()
        while not self._ended.is_set():
            now = time.monotonic()
            if now >= due:
                due = max(due + VELOCITY_S, now)
                self._report_velocity()
                self._deliver()
            if now >= echo_due:
                echo_due = max(echo_due + ECHO_S, now)
                self._echoes = self.ring.report(self._ranges())
            readable, _, _ = select.select([self._socket], [], [], STEP_S)
            self._receive() if readable else None
            now = time.monotonic()
            self._watch(now)
            self.vehicle.follow(self._command, self.faults, now - step_at)
            self._touch(now)
            self._deliver()
            step_at = now

    def _watch(self, now: float) -> None:
        if 0 < self.faults.watchdog < now - self._command.at:
            self._command = wire.Command(now, "stop", 0.0, 0.0)

    def _touch(self, now: float) -> None:
        """End the vehicle's way at the obstacle, and press the bumper there."""
        if self.wall is not None and self.vehicle.distance > self.wall:
            self.vehicle.collide(self.wall)
        touching = self.wall is not None and self.vehicle.distance > self.wall - TOUCH
        if touching != self._touching:
            self._touching, self._changed = touching, now
            self.contacts += [now] if touching else []

    def _report_velocity(self) -> None:
        off = self.faults.bias
        noise = [random.gauss(0.0, deviation) for deviation in self.faults.noise]
        true = (
            self.vehicle.linear + off[0] + noise[0], self.vehicle.angular + off[1] + noise[1]
        )  # fmt: skip
        if self.faults.dither:
            true = random.uniform(-0.03, 0.03), random.uniform(-0.03, 0.03)
        velocity = self.reported.pop(0) if self.reported else true
        for index in self.faults.velocity_ports:
            self._send(wire.velocity(*velocity), index)

    def _receive(self) -> None:
        with contextlib.suppress(BlockingIOError, ConnectionRefusedError):
            while True:
                datagram, (_, port) = self._socket.recvfrom(2048)
                if self.faults.silent:
                    continue
                index = self.host_ports.index(port) if port in self.host_ports else 0
                self._to_board.put(datagram, index, self.faults.ports[index], time.monotonic())
                self._deliver()

    def _deliver(self) -> None:
        """Pass on what has arrived by now at either end."""
        now = time.monotonic()
        for datagram, _ in self._to_board.take(now):
            for command, payload in wire.frames(datagram):
                self.received.append((now, command, payload))
                self._execute(command, payload, now)
        for datagram, index in self.packing.collected(now):
            self._to_host.put(datagram, index, self.faults.ports[index], now)
        for datagram, index in self._to_host.take(time.monotonic()):
            with contextlib.suppress(OSError):
                self._socket.sendto(datagram, ("127.0.0.1", self.host_ports[index]))

    def _execute(self, command: int, payload: bytes, now: float) -> None:
        if command == wire.MOTION:
            self._command = wire.motion(payload, now, self.command_unit)
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
            distance = self.vehicle.distance * self.faults.counts[0]
            heading = self.vehicle.heading * self.faults.counts[1]
            return wire.distance(distance + step * 0.001, heading + step * 0.00175)[8:]
        if command == wire.SONAR:
            return struct.pack("<8H", *self._echoes)
        if command == wire.BUMPER:
            return bytes([self._bumper() if index in self.faults.hit_ports else 0])
        if command == wire.DRIVER:
            return payload + bytes(4)
        return bytes([0x55]) if command == wire.LED else payload

    def _ranges(self) -> list[int]:
        if self.wall is None or not self.wall_echoes:
            return self.sonars
        return before(self.sonars, self.wall - self.vehicle.distance)

    def _bumper(self) -> int:
        chatters = time.monotonic() < self._changed + self.faults.bounce
        return self.bumper or (random.randint(0, 1) if chatters else int(self._touching))

    def _send(self, frame: bytes, index: int) -> None:
        if not self.faults.silent:
            for datagram in self.packing.pack(frame, index):
                self._to_host.put(datagram, index, self.faults.ports[index], time.monotonic())
