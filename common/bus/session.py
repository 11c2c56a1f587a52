"""Zenoh sessions: of clients, of the drive link, and of the embedded router."""

import contextlib
import getpass
import itertools
import json
import os
import socket
import ssl
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from math import ceil
from pathlib import Path
from typing import Any

import zenoh
from msgspec.structs import replace

from common.errors import ConfigError
from common.log import Logger
from common.loop import Post
from common.settings import BusSettings, is_encrypted
from t2.errors import LinkError
from t2.keys import FAST, FIX, MOTION, PICTURE, TOPICS
from t2.text_file import pem_problem

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
RUNTIME_ENV = "ZENOH_RUNTIME"  # Zenoh reads it once, when the first session opens
# Timeout of one connection attempt: five round trips of a bad link. After a change of address, a
# host may wait this long for an attempt from the old address.
OPEN_MS = 4_000
# Zenoh drops a larger received message, and keeps the link. By default any member could fill 1 GiB
# of memory for each priority. Our messages are far smaller (``sdk/t2/messages.py`` bounds them). A
# router also forwards messages of others: an uncompressed image of 1920 x 1080 pixels has 6 MB.
CLIENT_MAX, ROUTER_MAX = 8 * 2**20, 16 * 2**20
# In a certificate, first the issuer's and then the subject's: object id 2.5.4.3, then a text as its
# type, its length (one byte: at most 64) and its bytes. Python's `ssl` decodes no client's own.
COMMON_NAME = b"\x06\x03\x55\x04\x03"
# A router's sessions, and connections that have not opened one yet: together fewer than the 1024
# files that a process may open by default. Zenoh's limit of 1000 sessions is not.
MAX_SESSIONS, MAX_PENDING = 500, 100
RETRY = {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 1.5}
# Motions come in bursts, and each takes a batch because it is express. With Zenoh's two batches, up
# to one in five bursts of eight lost its newest message on a busy machine.
BURST = {"queue": {"size": {"interactive_high": 16}}, "batch_size": 8192}
# Connecting to a missing socket is cheap, and a restarted bridge is found within 100 ms.
REDIAL = {"period_init_ms": 100, "period_max_ms": 100, "period_increase_factor": 1.0}
# Links of laptops, which may be slow; services on board never use these.
DOWNSAMPLED = ("tls", "quic")
LAPTOP_PICTURES_HZ = 2.0  # of all cameras together


class Session:
    """One Zenoh session: declare first, then ``open``.

    ``zenoh.open`` must not wait (it ignores SIGINT then), so a thread retries it. The owner's
    thread makes the declarations as soon as it is open; Zenoh renews them after a lost connection.
    """

    def __init__(
        self, connect: Callable[[int], zenoh.Session], post: Post, missing: str, **about: object
    ) -> None:
        """``connect`` gets the number of the attempt; ``missing`` is logged while it fails."""
        self.zenoh: zenoh.Session | None = None  # once it is open, in the owner's thread
        self._connect = connect
        self._post = post
        self._missing, self._about = missing, about
        self._declarations: list[Callable[[zenoh.Session], Any]] = []
        self._declared: list[Any] = []  # references keep them alive
        self._transports = self._opened = 0  # open now; opened since the start
        self._found: zenoh.Session | None = None
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="bus-open", daemon=True)

    def declare(self, declare: Callable[[zenoh.Session], Any]) -> None:
        """Make a declaration, now or when the session opens."""
        self._declarations.append(declare)
        if self.zenoh is not None:
            self._declared.append(declare(self.zenoh))

    def open(self) -> None:
        """Start connecting; returns at once."""
        self._thread.start()

    @property
    def connection(self) -> int:
        """Number of the connection to a router or a drive link's other end, rising; 0: none."""
        return self._opened if self.zenoh is not None and self._transports else 0

    def close(self) -> None:
        """Stop connecting, and close the session if there is one."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join()
        self.zenoh = None
        if self._found is not None:
            self._found.close()

    def _run(self) -> None:
        warned_s = -WARN_PERIOD_S
        for attempt in itertools.count():
            if self._closing.is_set():
                return
            try:
                self._found = self._connect(attempt)
            except zenoh.ZError:
                if time.monotonic() - warned_s >= WARN_PERIOD_S:
                    warned_s = time.monotonic()
                    Logger().warning(self._missing, **self._about)
                self._closing.wait(RETRY_PERIOD_S)
                continue
            self._post(self._adopt)
            return

    def _adopt(self) -> None:
        if self._closing.is_set() or self._found is None:
            return
        listener = self._found.info.declare_transport_events_listener
        self._declared.append(listener(self._on_transport, history=True))
        self._declared += [declare(self._found) for declare in self._declarations]
        self.zenoh = self._found

    def _on_transport(self, event: zenoh.TransportEvent) -> None:
        """Count a transport that was opened or closed, on a thread of Zenoh."""
        opened = event.kind == zenoh.SampleKind.PUT
        self._transports += 1 if opened else -1
        self._opened += opened


def is_viewer(where: BusSettings) -> bool:
    """Return whether the certificate's role may neither drive nor stop, whatever the robot."""
    return all(map(is_encrypted, where.endpoints)) and common_name(where).startswith("viewer.")


def client(where: BusSettings, post: Post) -> Session:
    """Return a client's session; raise ``ConfigError`` for an unreadable certificate."""
    check_files(where, where.endpoints)
    return Session(
        lambda attempt: zenoh.open(client_config(where, attempt)),
        post,
        "waiting for a router; run `t2 doctor`",
        endpoints=list(where.endpoints),
    )


@contextlib.contextmanager
def router(
    where: BusSettings, access: Mapping[str, object] | None = None, robot: str = ""
) -> Iterator[None]:
    """Run the embedded router for the context; raise ``LinkError`` if it cannot listen."""
    check_files(where, (*where.listen, *where.uplink))
    for file in (each for each in where.listen if each.startswith("unixsock-stream/")):
        with contextlib.suppress(OSError):  # Zenoh reports the error
            Path(file.partition("/")[2]).parent.mkdir(parents=True, exist_ok=True)
    try:
        session = zenoh.open(_parsed(router_config(where, access, robot)))
    except zenoh.ZError as error:
        reason = str(error).split(" at /")[0]
        listen = ", ".join(where.listen)
        raise LinkError(f"the router cannot listen on {listen}: {reason}") from None
    with session:
        yield


def router_at(where: BusSettings) -> BusSettings:
    """Return the settings of a client of the router that listens there."""
    return replace(where, connect=replace(where, connect=()).endpoints[:1])


class RouterCheck:
    """Checks whether a router works: it accepts a session and answers an admin query.

    A router whose table of sessions is full refuses a new one at once; one that hangs does not
    reply. So the last session stays open, and is asked when a new one is refused.
    """

    def __init__(self, where: BusSettings) -> None:
        self._where = where
        self._kept: zenoh.Session | None = None
        self._is_full = False

    def answers(self) -> bool:
        """Check; a hanging router may block the caller for long: use a separate thread."""
        began_s = time.monotonic()
        try:
            session = zenoh.open(client_config(self._where, once=True))
        except zenoh.ZError:
            refused = time.monotonic() - began_s < OPEN_MS / 1000
            if refused and not self._is_full:
                Logger().warning("the router refuses new sessions", limit=MAX_SESSIONS)
            self._is_full = refused
            return refused and (self._kept is None or self._asks(self._kept))
        kept, self._kept, self._is_full = self._kept, session, False
        if kept is not None:
            kept.close()
        return self._asks(session)

    def _asks(self, session: zenoh.Session) -> bool:
        # A robot's router with a connection to a site's router is a peer.
        routers = (*session.info.routers_zid(), *session.info.peers_zid())
        return any(
            reply.ok
            for zid in routers
            for reply in session.get(f"@/{zid}/*", timeout=self._where.probe_deadline)
        )


def common_name(where: BusSettings) -> str:
    """Return the common name in the certificate; empty without a certificate."""
    try:
        pem = Path(where.certificate).read_text(encoding="ascii") if where.certificate else ""
        _, *_, subject = ssl.PEM_cert_to_DER_cert(pem).split(COMMON_NAME)
        return subject[2 : 2 + subject[1]].decode()
    except (OSError, ValueError):
        return ""


def operator_name(where: BusSettings) -> str:
    """Return who uses this program: the name in its certificate, or its login name and host."""
    if all(map(is_encrypted, where.endpoints)) and (name := common_name(where)):
        return name
    try:
        user = getpass.getuser()
    except (OSError, KeyError):  # a user without a name, in a container
        user = str(os.getuid())
    return f"{user}@{socket.gethostname()}"


def check_files(where: BusSettings, endpoints: Iterable[str]) -> None:
    """Raise ``ConfigError`` for an unusable certificate file of these endpoints."""
    if not any(map(is_encrypted, endpoints)):
        return
    for name in ("ca", "certificate", "private_key"):
        file = Path(getattr(where, name))
        try:
            problem = pem_problem(file.read_bytes())
        except OSError as error:
            raise ConfigError(f"bus.{name}: {file}: cannot be read: {error.strerror}") from None
        if problem:
            raise ConfigError(f"bus.{name}: {file}: {problem}")


# --- configurations -----------------------------------------------------------------------------


def client_config(where: BusSettings, attempt: int = 0, *, once: bool = False) -> zenoh.Config:
    """Return the configuration of a client of one of these routers, without scouting.

    Zenoh spends the whole timeout on a first endpoint that is silent, so each attempt begins with
    another one. With ``once`` it ends at the first refusal.
    """
    first = attempt % len(where.endpoints)
    endpoints = [*where.endpoints[first:], *where.endpoints[:first]]
    connect = {"endpoints": endpoints, "timeout_ms": 0 if once else 1500, "retry": RETRY}
    return _parsed(_common(where) | {"mode": "client", "connect": connect})


def drive_config(where: BusSettings, path: Path, *, listens: bool) -> zenoh.Config:
    """Return the configuration of one end of the drive link: one socket and no other endpoint."""
    here, nowhere = {"endpoints": [f"unixsock-stream/{path}"]}, {"endpoints": list[str]()}
    ends: dict[str, object] = {"listen": here, "connect": nowhere}
    if not listens:
        ends = {"listen": nowhere, "connect": {**here, "retry": REDIAL}}
    return _parsed(_common(where, BURST) | {"mode": "peer"} | ends)


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
        parts["downsampling"] = downsampling_rules(robot, where.laptop_rate)
    full = {"congestion_control": {"block": {"wait_before_close": BLOCKED_TIMEOUT_US}}}
    accepting = {
        "max_sessions": MAX_SESSIONS,
        "accept_pending": MAX_PENDING,
        "accept_timeout": OPEN_MS,
    }
    return _common(where, {"queue": full}, ROUTER_MAX, accepting) | parts


def downsampling_rules(robot: str, rate_hz: float) -> list[dict[str, Any]]:
    """Return the rules that limit each stream of a robot to ``rate_hz`` on a laptop's link.

    The state, events, answers and everything *from* laptops are not limited. Zenoh applies a limit
    per rule, not per key: a rule is for one robot, and for no topic with several sources.
    """
    streams = [it for it in TOPICS if it is MOTION or (it.service is FAST and it is not FIX)]
    rules: list[dict[str, Any]] = []
    for topic in streams:
        if topic.rate_hz > rate_hz:
            # Zenoh passes a sample when 1 / freq has elapsed: half a period earlier than due, so
            # that one that is slightly early passes, too.
            every = ceil(topic.rate_hz / rate_hz)
            rules.append({"key_expr": topic.on(robot), "freq": topic.rate_hz / (every - 0.5)})
    pictures = PICTURE.on(robot, camera="*")  # a page asks for them, by itself
    rules.append({"key_expr": pictures, "freq": LAPTOP_PICTURES_HZ})
    egress = {"id": "laptops", "flows": ["egress"], "messages": ["put"], "rules": rules}
    return [egress | {"link_protocols": list(DOWNSAMPLED)}]


def _parsed(config: Mapping[str, object]) -> zenoh.Config:
    return zenoh.Config.from_json5(json.dumps(config))


def _common(
    where: BusSettings,
    sending: Mapping[str, object] | None = None,
    largest: int = CLIENT_MAX,
    accepting: Mapping[str, int] | None = None,
) -> dict[str, object]:
    link: dict[str, object] = {
        "tx": {"lease": round(where.lease * 1000), "keep_alive": 4, **(sending or {})},
        "rx": {"max_message_size": largest},
    }
    if where.ca:  # mutual TLS: both ends present a certificate of the site's CA
        link["tls"] = {
            "root_ca_certificate": where.ca,
            "listen_certificate": where.certificate,
            "listen_private_key": where.private_key,
            "connect_certificate": where.certificate,
            "connect_private_key": where.private_key,
            "enable_mtls": True,
            "close_link_on_expiration": True,
        }
    return {
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        # The advanced publishers of evt/** need timestamps.
        "timestamping": {"enabled": True},
        "transport": {
            "link": link,
            "shared_memory": {"enabled": False},  # our frames are tiny
            "unicast": {"open_timeout": OPEN_MS, **(accepting or {})},
        },
    }
