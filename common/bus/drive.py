"""The drive link: the private session on which bridge and safety move the vehicle.

The bridge listens on a Unix socket and safety connects to it. Neither end has other endpoints, so
no message of the router can be mistaken for one of theirs (``docs/decisions.md#drive-link``).
"""

from collections.abc import Callable
from typing import Any, TypeVar

import zenoh

from common.bus.bus import Arrival, Bus
from common.bus.publisher import Publisher
from common.bus.session import WARN_PERIOD_S, Session, drive_config
from common.drive_socket import check_router, prepare, socket_path
from common.freshness import NS_PER_S
from common.log import Logger
from t2.keys import Topic
from t2.messages import Message

M = TypeVar("M", bound=Message)


class DriveLink:
    """One end of the drive link; it opens and closes with its bus."""

    def __init__(self, bus: Bus, *, listens: bool) -> None:
        """Raise ``ConfigError`` for several routers, or a socket that is not private."""
        self.other = "safety" if listens else "bridge"
        check_router(bus.where)
        self.socket = socket_path(bus.where, bus.robot)
        prepare(self.socket)
        self._bus = bus
        self._listens = listens
        taken = "the drive link cannot listen; is another bridge of this robot running?"
        self._session = Session(self._connect, bus.post, taken, socket=str(self.socket))
        bus.sessions.append(self._session)

    @property
    def connected(self) -> bool:
        """Whether the other end is there now."""
        return self._session.connection > 0

    def publisher(self, topic: Topic[M], **names: str) -> Publisher[M]:
        """Return a publisher for this link and then the bus: one message, encoded once."""
        publisher = self._bus.publisher(topic, **names)
        self._session.declare(lambda session: publisher.declare(session, first=True))
        return publisher

    def subscribe(
        self,
        topic: Topic[M],
        handler: Callable[[Arrival[M]], None],
        *,
        depth: int = 1,
        **names: Any,
    ) -> None:
        """Call the handler for each message of the other end; see ``Bus.subscribe``."""
        self._bus.subscribe(topic, handler, depth=depth, session=self._session, **names)

    def _connect(self, _: int) -> zenoh.Session:
        """Listen or connect; a connecting end retries until the other one listens."""
        config = drive_config(self._bus.where, self.socket, listens=self._listens)
        session = zenoh.open(config)
        if self._listens:
            self.socket.chmod(0o600)
        return session


class LinkWatch:
    """Reports that the other end of a drive link is missing, lost or back, by ``Node.event``."""

    def __init__(self, link: DriveLink, event: Callable[..., object]) -> None:
        self._link = link
        self._event = event
        self._was_up: bool | None = None  # None until the first connection
        self._since_ns: int | None = None  # last report of a missing end

    def check(self, now_ns: int) -> None:
        """Report what has changed since the last call."""
        up, other = self._link.connected, self._link.other
        if up and self._was_up is False:
            self._event("drive_link_up", "info", other=other)
        if self._was_up and not up:
            self._event("drive_link_lost", "error", other=other)
        self._was_up = up or (None if self._was_up is None else False)
        if up or self._since_ns is None:
            self._since_ns = now_ns
        elif now_ns - self._since_ns >= WARN_PERIOD_S * NS_PER_S:
            self._since_ns = now_ns
            Logger().warning(
                f"no {other} on the drive link; both must run as one user and with one bus.drive",
                socket=str(self._link.socket),
            )
