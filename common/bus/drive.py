"""The drive link: the private session on which bridge and safety move the vehicle.

The bridge listens on a Unix socket and safety connects to it. Neither end has other endpoints, so
no message of the router can be mistaken for one of theirs (``docs/decisions.md#drive-link``).
"""

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import zenoh

from common.bus.bus import Bus
from common.bus.publisher import Publisher
from common.bus.session import WARN_PERIOD_S, Opener, drive_config
from common.drive_socket import prepare, socket_path
from common.freshness import NS_PER_S
from common.keys import Topic
from common.log import Logger
from common.messages import Level, Message
from common.settings import BusSettings as Settings

M = TypeVar("M", bound=Message)


class DriveLink(Bus):
    """One end of the drive link; it opens and closes with its bus.

    Subscriptions receive only from the other end. Publications go to the other end first, and then
    to the bus for observers.
    """

    def __init__(self, bus: Bus, *, listens: bool) -> None:
        """Raise ``ConfigError`` when the socket cannot be created or others could connect."""
        self._bus = bus
        self._listens = listens
        self.other = "safety" if listens else "bridge"
        self.socket = socket_path(bus.where, bus.robot)
        prepare(self.socket)
        super().__init__(bus.where, bus.robot, bus.post, bus.submit)
        self.boot, self.counts, self.counters = bus.boot, bus.counts, bus.counters
        bus.links.append(self)

    def publisher(self, topic: Topic[M], **names: str) -> Publisher[M]:
        """Return a publisher for this link and the bus: one message, encoded once, on both."""
        publisher = self._bus.publisher(topic, **names)
        self.publishers.append(publisher)
        self._declare(lambda session: publisher.declare(session, first=True))
        return publisher

    def opener(self, adopt: Callable[[zenoh.Session], None]) -> Opener:
        """Return the opener that listens or connects."""
        return DriveOpener(self.where, self.socket, adopt, listens=self._listens)


class DriveOpener(Opener):
    """Opens one end of the drive link."""

    def __init__(
        self,
        where: Settings,
        socket: Path,
        adopt: Callable[[zenoh.Session], None],
        *,
        listens: bool,
    ) -> None:
        super().__init__(where, adopt)
        self._socket = socket
        self._listens = listens

    def opened(self, turn: int) -> zenoh.Session:
        """Listen or connect; a connecting end retries until the other one listens."""
        session = zenoh.open(drive_config(self._where, self._socket, listens=self._listens))
        if self._listens:
            self._socket.chmod(0o600)
        return session

    def warn(self) -> None:
        """Log that the socket cannot be opened."""
        Logger().warning(
            "the drive link cannot listen; is another bridge of this robot running?",
            socket=str(self._socket),
        )


class LinkWatch:
    """Reports that the other end of a drive link is missing, lost or back."""

    def __init__(self, link: DriveLink, event: Callable[[str, Level, str], None]) -> None:
        self._link = link
        self._event = event
        self._was_up: bool | None = None  # None until the first connection
        self._since_ns: int | None = None  # last report of a missing end

    def check(self, now_ns: int) -> None:
        """Report what has changed since the last call."""
        up = self._link.connected
        if up and self._was_up is False:
            self._event("drive_link_up", "info", f"the drive link to {self._link.other} is back")
        if self._was_up and not up:
            self._event("drive_link_lost", "error", f"the drive link to {self._link.other} is lost")
        self._was_up = up or (None if self._was_up is None else False)
        if up or self._since_ns is None:
            self._since_ns = now_ns
        elif now_ns - self._since_ns >= WARN_PERIOD_S * NS_PER_S:
            self._since_ns = now_ns
            Logger().warning(
                f"no {self._link.other} on the drive link; both must run as one user and with one "
                "bus.drive",
                socket=str(self._link.socket),
            )
