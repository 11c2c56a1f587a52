"""A fake main board for tests: real UDP, configurable answers, a record of received commands."""

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from common.wire import commands, framing, reports
from common.wire.commands import TO_BOARD, MotionCommand, MotionKind
from common.wire.frame import Frame
from common.wire.framing import Received
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until


class Board:
    """Answers every query and streams its velocity; tests change its fields while it runs."""

    def __init__(self) -> None:
        self.sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.sock.bind(("127.0.0.1", 0))
        self.sock.settimeout(0.02)
        self.address: tuple[str, int] = self.sock.getsockname()
        self.ports = [free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_DGRAM)]
        self.motions: list[MotionCommand] = []
        self.sources: list[tuple[str, int]] = []  # source address of each of ``motions``
        self.leds: list[commands.LedSet] = []
        self.silent = False
        self.to_ports = [0, 1]  # indices of the destination ports
        self.times: list[float] = []  # reception time of each of ``motions``
        self.pressed = False
        self.distance_mm = 1000
        self.speed_mmps: int | None = 0  # None: no velocity reports
        self.echo = True
        self.led_done: bool | None = True
        self._ended = threading.Event()

    def run(self) -> None:
        """Serve until ``end``."""
        while not self._ended.is_set():
            if self.speed_mmps is not None:
                self.say(reports.VelocityReport(self.speed_mmps, 0))
            try:
                datagram, source = self.sock.recvfrom(2048)
            except TimeoutError:
                continue
            for part in framing.read(datagram, TO_BOARD):
                assert isinstance(part, Received), part
                self._take(part.frame, source)

    def end(self) -> None:
        """Stop ``run``."""
        self._ended.set()

    def say(self, frame: Frame, sock: socket.socket | None = None) -> None:
        """Send a frame to the bridge's ports, as the board or from another socket."""
        self.say_bytes(framing.pack(frame), sock)

    def say_bytes(self, datagram: bytes, sock: socket.socket | None = None) -> None:
        """Send any bytes to the bridge's ports."""
        if self.silent:
            return
        for port in self.to_ports:
            (sock or self.sock).sendto(datagram, ("127.0.0.1", self.ports[port]))

    def last(self) -> MotionCommand | None:
        """Return the motion command that the board holds."""
        return self.motions[-1] if self.motions else None

    def wait_for(self, kind: MotionKind, linear_mmps: int = 0) -> None:
        """Wait until the board holds this command."""

        def holds() -> bool:
            last = self.last()
            return last is not None and (last.kind, last.linear_mmps) == (kind, linear_mmps)

        wait_until(holds, f"{kind.name} {linear_mmps} mm/s at the board, it has {self.last()}")

    def _take(self, frame: Frame, source: tuple[str, int]) -> None:
        if isinstance(frame, MotionCommand):
            self.times.append(time.monotonic())
            self.sources.append(source)
            self.motions.append(frame)
        elif isinstance(frame, commands.LedSet):
            self.leds.append(frame)
            if self.led_done is not None:
                self.say(reports.LedReport(self.led_done))
        else:
            for answer in self._answers(frame):
                self.say(answer)

    def _answers(self, frame: Frame) -> Iterator[Frame]:
        if isinstance(frame, commands.BumperQuery):
            yield reports.BumperReport(self.pressed)
        elif isinstance(frame, commands.DistanceQuery):
            yield reports.DistanceReport(self.distance_mm, 0)
        elif isinstance(frame, commands.UltrasonicQuery):
            yield reports.UltrasonicReport((1000,) * 8)
        elif isinstance(frame, commands.DriverQuery):
            yield reports.DriverReport(frame.side, 0)
        elif isinstance(frame, commands.UltrasonicBrakeSet):
            if self.echo:
                yield reports.UltrasonicBrakeReport(frame.on)
        elif isinstance(frame, commands.BumperBrakeSet) and self.echo:
            yield reports.BumperBrakeReport(frame.on)


@contextmanager
def board() -> Iterator[Board]:
    """Run a board."""
    made = Board()
    thread = threading.Thread(target=made.run, daemon=True)
    thread.start()
    try:
        yield made
    finally:
        made.end()
        thread.join(5)
        made.sock.close()
