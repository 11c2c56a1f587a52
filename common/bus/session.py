"""Sessions: how a client finds its router, and the embedded router itself."""

import contextlib
import json
import threading
import time
from collections.abc import Callable, Iterator, Sequence

import structlog
import zenoh

from common.errors import LinkError

RETRY_S = 0.5  # between two tries to find a router
COMPLAIN_S = 5.0  # between two lines that say so
LEASE_S = 1.0  # a silent partition is noticed after this long; Zenoh's default is 10 s


class Opener:
    """Looks for a router in a thread of its own, and hands the session over once.

    ``zenoh.open`` must not wait by itself (it ignores SIGINT then), so the waiting is done here.
    """

    def __init__(
        self, endpoints: Sequence[str], lease_s: float, adopt: Callable[[zenoh.Session], None]
    ) -> None:
        self._endpoints = list(endpoints)
        self._lease_s = lease_s
        self._adopt = adopt
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="bus-open", daemon=True)
        self._session: zenoh.Session | None = None
        self._log = structlog.get_logger()

    def start(self) -> None:
        """Begin to look; returns at once."""
        self._thread.start()

    def close(self) -> None:
        """Give up looking, and end the session that was found, handed over or not."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join()
        if self._session is not None:
            self._session.close()

    def _run(self) -> None:
        complained_s = -COMPLAIN_S
        while not self._closing.is_set():
            try:
                self._session = zenoh.open(client_config(self._endpoints, self._lease_s))
            except zenoh.ZError:
                if time.monotonic() - complained_s >= COMPLAIN_S:
                    complained_s = time.monotonic()
                    self._log.warning("waiting for a router", endpoints=self._endpoints)
                self._closing.wait(RETRY_S)
                continue
            self._adopt(self._session)
            return


def client_config(endpoints: Sequence[str], lease_s: float = LEASE_S) -> zenoh.Config:
    """Return how a service joins: a client of one of these routers, never by scouting."""
    connect = {
        "endpoints": list(endpoints),
        "timeout_ms": 1500,
        "retry": {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 1.5},
    }
    return _config(lease_s, mode="client", connect=connect)


@contextlib.contextmanager
def router(listen: Sequence[str], lease_s: float = LEASE_S) -> Iterator[None]:
    """Run the embedded router while the context lasts; raise ``LinkError`` if it cannot listen."""
    config = _config(
        lease_s,
        mode="router",
        listen={"endpoints": list(listen)},
        adminspace={"enabled": True, "permissions": {"read": True, "write": False}},
    )
    try:
        session = zenoh.open(config)
    except zenoh.ZError as error:
        reason = str(error).split(" at /")[0]
        raise LinkError(f"the router cannot listen on {', '.join(listen)}: {reason}") from None
    with session:
        yield


def _config(lease_s: float, **part: object) -> zenoh.Config:
    whole = part | {
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        # The advanced publishers behind evt/** want timestamps.
        "timestamping": {"enabled": True},
        "transport": {
            "link": {"tx": {"lease": round(lease_s * 1000), "keep_alive": 4}},
            "shared_memory": {"enabled": False},  # our frames are tiny
        },
    }
    return zenoh.Config.from_json5(json.dumps(whole))
