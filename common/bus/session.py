"""Zenoh sessions: of clients, of the drive link, and of the embedded router."""

import contextlib
import itertools
import json
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

import zenoh
from msgspec.structs import replace

from common.bus.downsampling import downsampling_rules
from common.errors import ConfigError, LinkError
from common.log import Logger
from common.sample import Sample
from common.settings import BusSettings, is_encrypted

RETRY_PERIOD_S = 0.5  # between two attempts to connect
WARN_PERIOD_S = 5.0  # between two warnings
# Data that must not be dropped (declarations, history) blocks a router on a full link, and with it
# all other links. Zenoh closes the link after 5 s by default: a disconnected laptop would stall the
# robot's own streams for that time.
BLOCKED_TIMEOUT_US = 100_000
# Zenoh closes a dead TCP link in a reader thread shared with other links, and waits up to 10 s for
# unsent data (SO_LINGER; no setting). The default is two threads, as many as a laptop has sessions.
# Each link that dies within 10 s occupies one; idle ones cost 20 kB.
READERS = "(rx:(worker_threads:32))"
# All pools of a service share the threads of one: by default each packet wakes a thread in three of
# them. One thread for each link, because a dead TCP link occupies its thread: with a single one, a
# router's host that is cut off stopped the drive link for 10 s.
ONE_POOL = (
    "(rx:(handover:app),acc:(handover:app),tx:(handover:app),net:(handover:app),"
    "app:(worker_threads:{links}))"
)
RUNTIME_ENV = "ZENOH_RUNTIME"  # Zenoh reads it once, on first use
# Timeout of one connection attempt: five round trips of a bad link. After a change of address, a
# host may wait this long for an attempt from the old address.
OPEN_MS = 4_000
# Zenoh drops a larger received message, and keeps the link. By default any member could fill 1 GiB
# of memory for each priority. Odometry's path, our largest message, has up to 6 MB. A router also
# forwards messages of others: an uncompressed image of 1920 x 1080 pixels has 6 MB.
CLIENT_MAX, ROUTER_MAX = 8 * 2**20, 16 * 2**20
RETRY = {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 1.5}
# Motions come in bursts, and each takes a batch because it is express. With Zenoh's two batches, up
# to one in five bursts of eight lost its newest message on a busy machine.
BURST = {"queue": {"size": {"interactive_high": 16}}, "batch_size": 8192}
# Connecting to a missing socket is cheap, and a restarted bridge is found within 100 ms.
REDIAL = {"period_init_ms": 100, "period_max_ms": 100, "period_increase_factor": 1.0}


class Opener:
    """Connects to a router in its own thread, and passes the session on once.

    ``zenoh.open`` must not wait (it ignores SIGINT then), so the retries are made here.
    """

    def __init__(self, where: BusSettings, adopt: Callable[[zenoh.Session], None]) -> None:
        check_files(where, where.endpoints)
        self._where = where
        self._adopt = adopt
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="bus-open", daemon=True)
        self._session: zenoh.Session | None = None

    def start(self) -> None:
        """Start connecting; returns at once."""
        self._thread.start()

    def close(self) -> None:
        """Stop connecting, and close the session if there is one."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join()
        if self._session is not None:
            self._session.close()

    def _run(self) -> None:
        warned_s = -WARN_PERIOD_S
        for turn in itertools.count():
            if self._closing.is_set():
                return
            try:
                self._session = self.opened(turn)
            except zenoh.ZError:
                if time.monotonic() - warned_s >= WARN_PERIOD_S:
                    warned_s = time.monotonic()
                    self.warn()
                self._closing.wait(RETRY_PERIOD_S)
                continue
            self._adopt(self._session)
            return

    def opened(self, turn: int) -> zenoh.Session:
        """Open a session, once; raise ``ZError`` on failure."""
        return zenoh.open(client_config(self._where, turn))

    def warn(self) -> None:
        """Log that there is no session yet."""
        Logger().warning(
            "waiting for a router; run `t2 doctor`", endpoints=list(self._where.endpoints)
        )


def client_config(where: BusSettings, turn: int = 0) -> zenoh.Config:
    """Return the configuration of a client of one of these routers, without scouting.

    Zenoh spends the whole timeout on a first endpoint that is silent, so each attempt begins with
    another one.
    """
    first = turn % len(where.endpoints)
    endpoints = [*where.endpoints[first:], *where.endpoints[:first]]
    connect = {"endpoints": endpoints, "timeout_ms": 1500, "retry": RETRY}
    return zenoh.Config.from_json5(
        json.dumps(_common(where, {}) | {"mode": "client", "connect": connect})
    )


def drive_config(where: BusSettings, socket: Path, *, listens: bool) -> zenoh.Config:
    """Return the configuration of one end of the drive link: one socket and no other endpoint."""
    ends: dict[str, object] = {"listen": {"endpoints": []}, "connect": {"endpoints": []}}
    endpoint = [f"unixsock-stream/{socket}"]
    if listens:
        ends["listen"] = {"endpoints": endpoint}
    else:
        ends["connect"] = {"endpoints": endpoint, "retry": REDIAL}
    whole = _common(where, BURST) | {"mode": "peer"} | ends
    return zenoh.Config.from_json5(json.dumps(whole))


def router_config(
    where: BusSettings, access: Mapping[str, object] | None = None, robot: str = ""
) -> dict[str, object]:
    """Return a router's configuration, as JSON.

    ``access`` is its ``access_control``; streams of ``robot`` are downsampled towards laptops.
    """
    parts: dict[str, object] = {
        "mode": "router",
        "listen": {"endpoints": list(where.listen)},
        "adminspace": {"enabled": True, "permissions": {"read": True, "write": False}},
    }
    if where.uplink:
        parts["connect"] = {"endpoints": list(where.uplink), "retry": RETRY}
        # Routers exchange all declarations of all; a peer exchanges only its own. The region name
        # identifies robots to a site's router that has an uplink of its own.
        parts |= {"mode": "peer", "region_name": "robot"}
    if access is not None:
        parts["access_control"] = access
    if robot:
        parts |= downsampling_rules(robot, where.laptop_rate)
    full = {"congestion_control": {"block": {"wait_before_close": BLOCKED_TIMEOUT_US}}}
    return _common(where, {"queue": full}, ROUTER_MAX) | parts


@contextlib.contextmanager
def router(
    where: BusSettings, access: Mapping[str, object] | None = None, robot: str = ""
) -> Iterator[None]:
    """Run the embedded router for the context; raise ``LinkError`` if it cannot listen."""
    check_files(where, (*where.listen, *where.uplink))
    for socket in (each for each in where.listen if each.startswith("unixsock-stream/")):
        with contextlib.suppress(OSError):  # Zenoh reports the error
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
    """Raise ``ConfigError`` for an unreadable certificate file of these endpoints."""
    if not any(map(is_encrypted, endpoints)):
        return
    for name in ("ca", "certificate", "private_key"):
        file = Path(getattr(where, name))
        try:
            file.read_bytes()
        except OSError as error:
            raise ConfigError(f"bus.{name}: {file}: cannot be read: {error.strerror}") from None


def _common(
    where: BusSettings, sending: Mapping[str, object], largest: int = CLIENT_MAX
) -> dict[str, object]:
    link: dict[str, object] = {
        "tx": {
            "lease": round(where.lease * 1000),
            "keep_alive": 4,
            **sending,
        },
        "rx": {"max_message_size": largest},
    }
    if where.ca:
        link["tls"] = _tls(where)
    return {
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        # The advanced publishers of evt/** need timestamps.
        "timestamping": {"enabled": True},
        "transport": {
            "link": link,
            "shared_memory": {"enabled": False},  # our frames are tiny
            "unicast": {"open_timeout": OPEN_MS},
        },
    }


def _tls(where: BusSettings) -> dict[str, object]:
    """Return the mutual TLS settings: both ends present a certificate of the site's CA."""
    return {
        "root_ca_certificate": where.ca,
        "listen_certificate": where.certificate,
        "listen_private_key": where.private_key,
        "connect_certificate": where.certificate,
        "connect_private_key": where.private_key,
        "enable_mtls": True,
        "close_link_on_expiration": True,
    }


def copied(sample: zenoh.Sample, received_ns: int, wall_ns: int) -> Sample:
    """Return a copy of a sample, without Zenoh's buffers."""
    return Sample(
        key=str(sample.key_expr),
        payload=sample.payload.to_bytes(),
        encoding=str(sample.encoding),
        deleted=sample.kind == zenoh.SampleKind.DELETE,
        raw=sample.attachment.to_bytes() if sample.attachment else None,
        received_ns=received_ns,
        wall_ns=wall_ns,
    )


def router_at(where: BusSettings) -> BusSettings:
    """Return the settings of a client of the router that listens there."""
    return replace(where, connect=replace(where, connect=()).endpoints[:1])


def answers(where: BusSettings) -> bool:
    """Return whether a router works: it accepts a session and answers an admin query.

    A hanging router may block the caller for long: use a separate thread.
    """
    with contextlib.suppress(zenoh.ZError), zenoh.open(client_config(where)) as session:
        # A robot's router with a connection to a site's router is a peer.
        routers = (*session.info.routers_zid(), *session.info.peers_zid())
        return any(
            reply.ok
            for zid in routers
            for reply in session.get(f"@/{zid}/*", timeout=where.probe_deadline)
        )
    return False
