"""Where a recording is played to: the bus, a simulated vehicle's safety service, or a bridge."""

import ipaddress
import secrets
import socket
import time
from types import TracebackType
from typing import Protocol, Self

from msgspec.structs import replace

from cli.inspect.addressing import topic_of
from cli.inspect.permission import check
from cli.inspect.shell import Seat
from cli.recordings.replay.plan import refusal
from common import codec, keys
from common.bus.host import host_id
from common.errors import LinkError, MessageError, RobotError
from common.messages import Drive, SafetyState
from common.sample import Sample
from common.settings import Board


class Target(Protocol):
    """Takes one sample after the other; ``look`` raises ``RobotError`` once it must no more."""

    def play(self, path: str, sample: Sample) -> bool:
        """Play a sample of this key below the robot; tell whether there was something to play."""

    def look(self) -> None:
        """See whether all is still as it has to be."""


class BusTarget:
    """The keys of a robot that has no bridge and no safety service."""

    def __init__(self, seat: Seat, robot: str) -> None:
        """Raise ``RobotError`` when there is one."""
        self._probe = seat.probe
        self._robot = robot
        self.look()

    def alive(self) -> set[str]:
        """Return the services that are there, by name."""
        tokens = self._probe.alive(keys.live_key(self._robot, "*", "*"))
        return {token.split("/")[-2] for token in tokens}

    def look(self) -> None:
        """Raise ``RobotError`` when somebody has come whose word this would be."""
        why = refusal(self._robot, self.alive())
        if why:
            raise RobotError(why)

    def play(self, path: str, sample: Sample) -> bool:
        """Put it again, to the byte."""
        if sample.deleted:
            return False
        self._put(path, sample.payload, sample.encoding, sample.raw)
        return True

    def _put(self, path: str, payload: bytes, encoding: str, raw: bytes | None) -> None:
        key = f"{keys.ROOT}/{self._robot}/{path}"
        topic = topic_of(key)
        service = topic.service if topic else keys.SLOW
        self._probe.put(key, payload, encoding, service, raw)


class SimulatorTarget(BusTarget):
    """The safety service of a simulated vehicle: what was asked is asked again, as if now."""

    def __init__(self, seat: Seat, robot: str) -> None:
        """Raise ``RobotError`` when the vehicle is not a simulated one."""
        self._boot, self._host, self._seq = secrets.randbits(63), host_id(), 0
        self._heartbeat = 0
        check(keys.MOTION.on(robot), True, seat.probe)
        super().__init__(seat, robot)
        seat.probe.listen(keys.SAFETY.on(robot))

    def look(self) -> None:
        """Here the services have to be there, and safety decides."""

    def play(self, path: str, sample: Sample) -> bool:
        """Ask again, with safety's own heartbeat of now; stop again."""
        if path == keys.ESTOP_PATH:
            self._probe.put(keys.estop_key(self._robot), b"", "", keys.ESTOP_CLASS)
            return True
        try:
            asked = codec.decode(sample.payload, Drive)
        except MessageError:
            return False
        self._seq += 1
        drive = replace(
            asked, echo=self._newest_heartbeat(), seq=self._seq, boot=self._boot, host=self._host,
            t_ns=time.time_ns(), mono_ns=time.monotonic_ns(),
        )  # fmt: skip
        self._put(path, codec.encode(drive), codec.encoding(Drive), None)
        return True

    def _newest_heartbeat(self) -> int:
        while heard := self._probe.take(0.0):
            if heard.key == keys.SAFETY.on(self._robot):
                self._heartbeat = codec.decode(heard.payload, SafetyState).heartbeat
        return self._heartbeat


class BoardTarget:
    """A bridge on this host, which takes us for its board: the raw frames of the recording."""

    def __init__(self, board: Board) -> None:
        """Raise ``RobotError`` when the board is not on this host, ``LinkError`` for its port."""
        if not ipaddress.ip_address(board.address).is_loopback:
            raise RobotError(f"--frames: the board is at {board.address}: a real one")
        self._to = board.listen_address, board.listen_ports[0]
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((board.address, board.port))
        except OSError as error:
            self._socket.close()
            raise LinkError(
                f"cannot be the board at {board.address}:{board.port}: {error.strerror}; "
                "is a simulated one running?"
            ) from None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._socket.close()

    def look(self) -> None:
        """Nothing can change."""

    def play(self, path: str, sample: Sample) -> bool:
        """Send the frame that stands beside a message."""
        if sample.raw is None:
            return False
        self._socket.sendto(sample.raw, self._to)
        return True
