"""Targets of a replay: the bus, the safety service of a simulated vehicle, or a bridge."""

import ipaddress
import secrets
import socket
import time
from typing import Protocol, Self

from msgspec.structs import replace

from cli.inspect.addressing import topic_of
from cli.inspect.pub import check_permission
from cli.inspect.session import BusSession
from cli.recordings.replay.plan import refusal
from common import clock, codec, keys
from common.bus.publisher import host_id
from common.codec import Sample
from common.errors import LinkError, MessageError, RobotError
from common.messages import Drive, SafetyState
from common.settings import Board


class Target(Protocol):
    """Plays samples; ``check`` raises ``RobotError`` when the replay must end."""

    def play(self, path: str, sample: Sample) -> bool:
        """Play a sample of this key below the robot; return whether anything was sent."""

    def check(self) -> None:
        """Check that the replay may continue."""


class BusTarget:
    """The keys of a robot without a running bridge or safety service."""

    def __init__(self, session: BusSession, robot: str) -> None:
        """Raise ``RobotError`` if one of them is running."""
        self._probe = session.probe
        self._robot = robot
        self.check()

    def alive(self) -> set[str]:
        """Return the names of the running services."""
        tokens = self._probe.alive(keys.live_key(self._robot, "*", "*"))
        return {token.split("/")[-2] for token in tokens}

    def check(self) -> None:
        """Raise ``RobotError`` if a bridge or safety service has started."""
        why = refusal(self._robot, self.alive())
        if why:
            raise RobotError(why)

    def play(self, path: str, sample: Sample) -> bool:
        """Publish the original bytes."""
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
    """The safety service of a simulated vehicle: receives the drive requests with new headers."""

    def __init__(self, session: BusSession, robot: str) -> None:
        """Raise ``RobotError`` if the vehicle is not simulated."""
        self._boot, self._host, self._seq = secrets.randbits(63), host_id(), 0
        self._heartbeat = 0
        check_permission(keys.MOTION.on(robot), True, session.probe)
        super().__init__(session, robot)
        session.probe.listen(keys.SAFETY.on(robot))

    def check(self) -> None:
        """Accept running services: safety decides about the requests."""

    def play(self, path: str, sample: Sample) -> bool:
        """Send a drive request with safety's current heartbeat, or an emergency stop."""
        if path == keys.ESTOP_PATH:
            self._probe.put(keys.estop_key(self._robot), b"", "", keys.ESTOP_CLASS)
            return True
        try:
            request = codec.decode(sample.payload, Drive)
        except MessageError:
            return False
        self._seq += 1
        drive = replace(
            request, echo=self._newest_heartbeat(), seq=self._seq, boot=self._boot, host=self._host,
            t_ns=time.time_ns(), mono_ns=clock.now_ns(),
        )  # fmt: skip
        self._put(path, codec.encode(drive), codec.encoding(Drive), None)
        return True

    def _newest_heartbeat(self) -> int:
        while sample := self._probe.take(0.0):
            if sample.key == keys.SAFETY.on(self._robot):
                self._heartbeat = codec.decode(sample.payload, SafetyState).heartbeat
        return self._heartbeat


class BoardTarget:
    """A bridge on this host: receives the raw frames as if from its board."""

    def __init__(self, board: Board) -> None:
        """Raise ``RobotError`` if the board is elsewhere, ``LinkError`` if its port is taken."""
        if not ipaddress.ip_address(board.address).is_loopback:
            raise RobotError(f"--frames: the board at {board.address} is a real one")
        self._to = board.listen_address, board.listen_ports[0]
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((board.address, board.port))
        except OSError as error:
            self._socket.close()
            raise LinkError(
                f"cannot act as the board at {board.address}:{board.port}: {error.strerror}; "
                "is a simulated one running?"
            ) from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def check(self) -> None:
        """Do nothing: no condition can change."""

    def play(self, path: str, sample: Sample) -> bool:
        """Send the raw frame attached to a message."""
        if sample.raw is None:
            return False
        self._socket.sendto(sample.raw, self._to)
        return True
