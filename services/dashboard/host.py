"""The dashboard's process: the node's loop in a thread of its own, the web server in the main one.

A slow browser therefore never delays a zero request. The end of either ends the other: a signal
stops the server, then the loop sends its final zeros; an exception in the loop stops the server.
"""

import secrets
import signal
import ssl
import sys
import threading
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from common import clock, log
from common.config import Loaded
from common.errors import ConfigError
from common.service import STOP_TIMEOUT_S, Node
from common.systemd import Systemd
from services.dashboard import floor_plan
from services.dashboard.auth import TOKEN_MIN, Credentials
from services.dashboard.config import Dashboard, DashboardConfig
from services.dashboard.fleet import Fleet
from services.dashboard.server import listen, page, reachable, serving
from services.dashboard.websocket_hub import WebSocketHub
from t2.text_file import pem_problem, read_text


class Host:
    """The dashboard's process: node, fleet and web server."""

    def __init__(self, loaded: Loaded[DashboardConfig], words: Sequence[str]) -> None:
        """``words`` are the options that name sources of settings, for hints."""
        settings = loaded.config.dashboard
        self._credentials = credentials(settings)
        check_certificate(settings)
        plan = floor_plan.read(settings)
        # The server's thread counts, the node's reads: all names exist from the start.
        counters = Counter({"requests_displaced": 0, "connections_aborted": 0})
        self._socket = listen(settings, counters)
        log.configure(loaded.config.log, "dashboard")
        self._node = node = Node("dashboard", loaded)
        node.counters = counters
        self._fleet = Fleet(node)
        hub = WebSocketHub(node.loop.post, self._fleet)
        node.announce()
        self._systemd = Systemd()
        self._server = serving(
            settings,
            loaded.config.robot.id,
            self._credentials,
            hub,
            self._socket,
            template=page(settings, loaded.config.bus.endpoints, words),
            plan=plan,
            alive=self._alive,
        )
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._serve, name="fleet")

    def run(self) -> int:
        """Run the server in the main thread and return the exit code."""
        for number in (signal.SIGINT, signal.SIGTERM):
            # The server handles the signal and raises it again when it has ended.
            signal.signal(number, lambda *_: None)
        self._node.open()
        self._thread.start()
        self._log_address()
        try:
            self._server.run(sockets=[self._socket])
        finally:
            self._systemd.stopping()
            self._node.loop.post(self._fleet.end)
            self._thread.join(STOP_TIMEOUT_S)
        if self._error:
            raise self._error
        return 0

    def _alive(self) -> None:
        """Notify systemd through both loops, the server's and the node's: both must work."""
        self._node.loop.post(lambda: self._systemd.ready(clock.now_ns()))

    def _serve(self) -> None:
        try:
            self._node.loop.run()
        except BaseException as error:  # raised again in the main thread, once the server is down
            self._error = error
            self._server.should_exit = True
        self._fleet.close()
        self._node.close()
        self._node.log.info("stopped")

    def _log_address(self) -> None:
        settings = self._node.config.dashboard
        scheme = "https" if settings.certificate else "http"
        url = f"{scheme}://{reachable(settings.host)}:{settings.port}/"
        if self._credentials.token and not settings.token_file:
            url += f"?token={self._credentials.token}"
        self._node.log.info("started", robot=self._node.config.robot.id, open=url)
        if sys.stderr.isatty():
            sys.stderr.write(f"\n    {url}\n\n")  # alone, so that a terminal makes it a link


def credentials(settings: Dashboard) -> Credentials:
    """Return the required token, with a salt that lasts as long as its file: so do the logins.

    The time when the file was written, in ns, and its inode are known to nobody on the network.
    """
    required = token(settings)
    if not settings.token_file:
        return Credentials(required)
    file = Path(settings.token_file).stat()
    return Credentials(required, f"{file.st_mtime_ns} {file.st_ino}")


def token(settings: Dashboard) -> str:
    """Return the required token: none for this host alone, else the file's or a new one."""
    if not settings.token_file:
        return "" if settings.is_local else secrets.token_urlsafe(12)
    try:
        given = read_text(Path(settings.token_file)).strip()
    except OSError as error:
        reason = error.strerror
        raise ConfigError(
            f"dashboard.token_file {settings.token_file}: cannot be read: {reason}"
        ) from None
    except ValueError as error:
        raise ConfigError(f"dashboard.token_file {settings.token_file}: {error}") from None
    if not given.isprintable():
        raise ConfigError(
            f"dashboard.token_file {settings.token_file}: the token has a second line or an "
            "invisible character: write one line"
        )
    if len(given) < TOKEN_MIN:
        raise ConfigError(
            f"dashboard.token_file {settings.token_file}: the token has {len(given)} characters, "
            f"at least {TOKEN_MIN} are required"
        )
    return given


def check_certificate(settings: Dashboard) -> None:
    """Raise ``ConfigError`` if the files for https cannot be used."""
    if not settings.certificate:
        return
    try:
        for name in ("certificate", "private_key"):
            file = Path(getattr(settings, name))
            if problem := pem_problem(file.read_bytes()):
                raise ConfigError(f"dashboard.{name} {file}: {problem}")
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(settings.certificate, settings.private_key)
    except OSError as error:
        raise ConfigError(
            f"dashboard.certificate {settings.certificate}, "
            f"dashboard.private_key {settings.private_key}: {error.strerror or error}"
        ) from None
