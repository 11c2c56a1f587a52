"""The link message: frame rates, rejected frames, and why a RUN would be refused. Pure."""

from collections import Counter

from common import messages as m
from common.settings import Board
from services.bridge.config import ASKED
from services.bridge.motion_output import MotionOutput
from services.bridge.output import Output
from services.bridge.poll import Poll
from services.bridge.ports import Ports
from services.bridge.readiness import Readiness


class LinkReport:
    """Counts frames by kind and refusals by reason, and publishes them with the link's state."""

    def __init__(
        self, board: Board, readiness: Readiness, motions: MotionOutput, ports: Ports, poll: Poll
    ) -> None:
        """Set up with the components whose state the message reports, read-only."""
        self.frames: Counter[str] = Counter()  # since the last second
        self.rejected: Counter[str] = Counter()
        self._board = board
        self._readiness = readiness
        self._motions = motions
        self._ports = ports
        self._poll = poll
        self._rates: dict[str, float] = {}
        self._published: tuple[object, ...] = ()

    def second(self) -> None:
        """Update the frame rates of the last second, in Hz."""
        self._rates = {name: float(count) for name, count in sorted(self.frames.items())}
        self.frames.clear()

    def is_due(self, now_ns: int) -> bool:
        """Return whether the newest message is out of date."""
        return self._published != self._state(now_ns)

    def publish(self, now_ns: int, send_errors: int, out: Output) -> None:
        """Publish the message; ``send_errors``: datagrams that the system did not send."""
        self._published = self._state(now_ns)
        waiting = self._waiting(now_ns)
        numbers = self._board.listen_ports
        message = m.Link(
            state=self._readiness.link.state,
            board=f"{self._board.address}:{self._board.port}",
            epoch=self._readiness.epoch,
            armed=not waiting,
            waiting=waiting,
            rates=self._rates,
            rejected={reason: count for reason, count in self.rejected.items() if count},
            round_trip=self._poll.round_trip_s(),
            latched_by=self._motions.lease.latched_by,
            ports={name: numbers[port] for name, port in self._ports.by_name().items()},
            send_errors=send_errors,
            relay=self._readiness.relay.message(),
            estop=self._motions.lease.estop,
        )
        out.publish("link", message)

    def _state(self, now_ns: int) -> tuple[object, ...]:
        return self._readiness.link.state, self._readiness.epoch, self._waiting(now_ns)

    def _waiting(self, now_ns: int) -> str:
        """Describe why a RUN would be refused, and which queries get no answer."""
        waiting = self._readiness.waiting() or self._motions.lease.waiting
        if not waiting or self._readiness.link.state != "up":
            return waiting
        silent = [name for name, kind in ASKED.items() if not self._ports.is_received(kind, now_ns)]
        return f"{waiting}; no answers to: {', '.join(silent)}" if silent else waiting
