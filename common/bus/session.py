"""Sessions: how a client finds its router, and the embedded router itself."""

import contextlib
import itertools
import json
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

import zenoh

from common.bus.downsampling import thinned
from common.errors import ConfigError, LinkError
from common.log import Logger
from common.settings import BusSettings, is_encrypted

RETRY_S = 0.5  # between two tries to find a router
COMPLAIN_S = 5.0  # between two lines that say so
# What may not be dropped (declarations, their history) makes a router wait for a link that is full,
# with all others waiting behind. Zenoh's default is 5 s, then the link is closed: a laptop that was
# cut off would stop the robot's own streams for as long.
FULL_US = 100_000
# Zenoh ends a dead TCP link in a thread that reads from the others, and waits up to 10 s there for
# what was not sent (SO_LINGER; no setting). It has two, as many as a laptop has sessions. Each link
# that dies within 10 s takes one; idle ones cost 20 kB. For the process of a router: `READERS_ENV`.
READERS = "(rx:(worker_threads:32))"
READERS_ENV = "ZENOH_RUNTIME"
# For one try to dial. Who has just got another address may have dialled from the old one, and waits
# this long for nothing; five ways there and back of a bad link fit in it.
OPEN_MS = 4_000
RETRY = {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 1.5}
# Verdicts come in bursts, and each takes a batch because it is express. With Zenoh's two batches a
# burst of eight lost its newest up to once in five on a busy machine.
BURST = {"queue": {"size": {"interactive_high": 16}}, "batch_size": 8192}
# Dialling a missing socket is cheap, and a restarted bridge is found within 100 ms.
REDIAL = {"period_init_ms": 100, "period_max_ms": 100, "period_increase_factor": 1.0}


class Opener:
    """Looks for a router in a thread of its own, and hands the session over once.

    ``zenoh.open`` must not wait by itself (it ignores SIGINT then), so the waiting is done here.
    """

    def __init__(self, where: BusSettings, adopt: Callable[[zenoh.Session], None]) -> None:
        check_files(where, where.endpoints)
        self._where = where
        self._adopt = adopt
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="bus-open", daemon=True)
        self._session: zenoh.Session | None = None

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
        for turn in itertools.count():
            if self._closing.is_set():
                return
            try:
                self._session = self.opened(turn)
            except zenoh.ZError:
                if time.monotonic() - complained_s >= COMPLAIN_S:
                    complained_s = time.monotonic()
                    self.complain()
                self._closing.wait(RETRY_S)
                continue
            self._adopt(self._session)
            return

    def opened(self, turn: int) -> zenoh.Session:
        """Open a session, once; raise ``ZError`` when that fails."""
        return zenoh.open(client_config(self._where, turn))

    def complain(self) -> None:
        """Log that there is no session yet."""
        Logger().warning(
            "waiting for a router; `t2 doctor` looks further", endpoints=list(self._where.endpoints)
        )


def client_config(where: BusSettings, turn: int = 0) -> zenoh.Config:
    """Return how a service joins: a client of one of these routers, never by scouting.

    Zenoh waits for the first endpoint, if it is silent, until there is no time left for the others:
    each try begins with another one.
    """
    first = turn % len(where.endpoints)
    endpoints = [*where.endpoints[first:], *where.endpoints[:first]]
    connect = {"endpoints": endpoints, "timeout_ms": 1500, "retry": RETRY}
    return zenoh.Config.from_json5(
        json.dumps(_common(where) | {"mode": "client", "connect": connect})
    )


def drive_config(where: BusSettings, socket: Path, *, listens: bool) -> zenoh.Config:
    """Return the configuration of one end of the drive link: one socket and no other endpoint."""
    ends: dict[str, object] = {"listen": {"endpoints": []}, "connect": {"endpoints": []}}
    endpoint = [f"unixsock-stream/{socket}"]
    if listens:
        ends["listen"] = {"endpoints": endpoint}
    else:
        ends["connect"] = {"endpoints": endpoint, "retry": REDIAL}
    whole = _common(where, **BURST) | {"mode": "peer"} | ends
    return zenoh.Config.from_json5(json.dumps(whole))


def router_config(
    where: BusSettings, access: Mapping[str, object] | None = None, robot: str = ""
) -> dict[str, object]:
    """Return a router's whole configuration, as JSON.

    ``access`` is its ``access_control``; ``robot`` is whose streams it thins towards laptops.
    """
    parts: dict[str, object] = {
        "mode": "router",
        "listen": {"endpoints": list(where.listen)},
        "adminspace": {"enabled": True, "permissions": {"read": True, "write": False}},
    }
    if where.uplink:
        parts["connect"] = {"endpoints": list(where.uplink), "retry": RETRY}
        # Routers among themselves learn every declaration of all; a peer tells one, and hears its
        # own. A site's router that dials on knows robots by the name.
        parts |= {"mode": "peer", "region_name": "robot"}
    if access is not None:
        parts["access_control"] = access
    if robot:
        parts |= thinned(robot, where.laptop_rate)
    full = {"congestion_control": {"block": {"wait_before_close": FULL_US}}}
    return _common(where, queue=full) | parts


@contextlib.contextmanager
def router(
    where: BusSettings, access: Mapping[str, object] | None = None, robot: str = ""
) -> Iterator[None]:
    """Run the embedded router while the context lasts; raise ``LinkError`` if it cannot listen."""
    check_files(where, (*where.listen, *where.uplink))
    for socket in (each for each in where.listen if each.startswith("unixsock-stream/")):
        with contextlib.suppress(OSError):  # what is wrong with it, Zenoh says
            Path(socket.partition("/")[2]).parent.mkdir(parents=True, exist_ok=True)
    try:
        config = json.dumps(router_config(where, access, robot))
        session = zenoh.open(zenoh.Config.from_json5(config))
    except zenoh.ZError as error:
        reason = str(error).split(" at /")[0]
        listen = ", ".join(where.listen)
        raise LinkError(f"the router cannot listen on {listen}: {reason}") from None
    with session:
        yield


def check_files(where: BusSettings, endpoints: Iterable[str]) -> None:
    """Raise ``ConfigError`` for a file that these endpoints want and that cannot be read."""
    if not any(map(is_encrypted, endpoints)):
        return
    for name in ("ca", "certificate", "private_key"):
        file = Path(getattr(where, name))
        try:
            file.read_bytes()
        except OSError as error:
            raise ConfigError(f"bus.{name}: {file}: cannot be read: {error.strerror}") from None


def _common(where: BusSettings, **sending: object) -> dict[str, object]:
    link: dict[str, object] = {
        "tx": {
            "lease": round(where.lease * 1000),
            "keep_alive": 4,
            **sending,
        }
    }
    if where.ca:
        link["tls"] = _tls(where)
    return {
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        # The advanced publishers behind evt/** want timestamps.
        "timestamping": {"enabled": True},
        "transport": {
            "link": link,
            "shared_memory": {"enabled": False},  # our frames are tiny
            "unicast": {"open_timeout": OPEN_MS},
        },
    }


def _tls(where: BusSettings) -> dict[str, object]:
    """Both ends show a certificate of the site's own CA, whoever dials."""
    return {
        "root_ca_certificate": where.ca,
        "listen_certificate": where.certificate,
        "listen_private_key": where.private_key,
        "connect_certificate": where.certificate,
        "connect_private_key": where.private_key,
        "enable_mtls": True,
        "close_link_on_expiration": True,
    }
