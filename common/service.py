"""Life cycle of a service: arguments, settings, logs, signals, presence, health, loop, exit.

``run`` reads the settings (exit code 78 names the invalid one, before anything opens), builds the
service around a ``Node``, and runs it until SIGINT or SIGTERM. The first signal lets the service
stop in order; a second one ends the process at once. The exit actions run once on every exit path,
and signals are ignored while they run.
"""

import os
import signal
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from importlib import import_module
from itertools import count
from pathlib import Path
from types import FrameType
from typing import Generic, TypeVar

import msgspec

from common import clock, log, realtime
from common.bus.bus import Bus
from common.bus.drive import DriveLink, LinkWatch
from common.bus.session import ONE_POOL, RUNTIME_ENV
from common.cli_args import EXIT_CONFIG, EXIT_LINK, VERSION, arguments, needs_extra, sources
from common.config import Loaded, Sources, load
from common.errors import ConfigError
from common.freshness import NS_PER_S
from common.loop import Loop
from common.settings import Shared
from common.systemd import CHECK_PERIOD_S, Systemd
from t2 import keys
from t2.errors import LinkError, T2Error
from t2.messages import (
    MAX_TEXT,
    Durations,
    Event,
    EventName,
    Field,
    Health,
    Level,
    Phrase,
    Setting,
    Settings,
)
from t2.words import render

STOP_TIMEOUT_S = 2.0  # limit for ``is_stopped`` after the first signal
QUERY_PERIOD_S = 0.02  # one query of each key
SETTINGS_PERIOD_S = 10.0  # of the published settings
NICENESS = 10  # of services that do not drive


C = TypeVar("C", bound=Shared)


class Node(Generic[C]):
    """Base of a service: settings, loop, bus, events and counters."""

    drive: DriveLink  # of bridge and safety, see ``open_drive``

    def __init__(self, name: str, loaded: Loaded[C]) -> None:
        self.name = name
        self.config: C = loaded.config
        self.loop = Loop()
        self.log = log.Logger()
        self.buses: list[Bus] = []
        self.bus = self.open_bus()
        self.loop.every(QUERY_PERIOD_S, lambda _: self._answer_queries())
        self.counters: Counter[str] = Counter()
        self.is_stopped: Callable[[], bool] = lambda: True  # polled while stopping
        self.on_exit: Callable[[], None] = lambda: None  # on every exit path, crashes included
        self.reactions: Callable[[], dict[str, Durations]] = dict  # part of the health message
        # As they are published and answered; readers decode them, and refuse a longer text.
        self._settings = Settings(
            settings={
                path: Setting(value=setting.value, origin=setting.origin[:MAX_TEXT])
                for path, setting in loaded.settings.items()
            }
        )
        self._events = self.bus.publisher(keys.EVENTS, service=name)
        self._health = self.bus.publisher(keys.HEALTH, service=name)
        self._settings_to = self.bus.publisher(keys.SETTINGS, service=name)
        self._settings_due_ns: int | None = None  # None: without a subscriber
        self._started_ns = self._reported_ns = clock.now_ns()
        self._counted: Counter[str] = Counter()

    def open_bus(self) -> Bus:
        """Return a bus with a session of its own; all open and close together."""
        bus = Bus(self.config.bus, self.config.robot.id, self.loop.post)
        self.buses.append(bus)
        return bus

    def open(self) -> None:
        """Start connecting all sessions; returns at once."""
        links = sum(len(bus.sessions) for bus in self.buses)
        os.environ.setdefault(RUNTIME_ENV, ONE_POOL.format(links=links))
        for bus in self.buses:
            bus.open()

    def close(self) -> None:
        """Close all sessions, and the loop."""
        for bus in self.buses:
            bus.close()
        self.loop.close()

    def open_drive(self, *, listens: bool) -> DriveLink:
        """Create this service's end of the drive link; it opens and closes with ``bus``."""
        self.drive = DriveLink(self.bus, listens=listens)
        self.loop.every(1.0, LinkWatch(self.drive, self.event).check)
        return self.drive

    def event(self, name: EventName, level: Level, *phrases: Phrase, **about: Field) -> None:
        """Publish and log an event; without phrases it has the text of its name.

        Texts are cut to the length that a message may have.
        """
        cut = {key: v[:MAX_TEXT] if isinstance(v, str) else v for key, v in about.items()}
        phrases = phrases or (Phrase(f"event.{name}", cut),)
        text = render(phrases)[:MAX_TEXT]
        self._events.put(Event(name=name, level=level, text=text, phrases=phrases, about=cut))
        getattr(self.log, level)(text, event_name=name, **about)

    def announce(self) -> None:
        """Declare the liveliness token, the info queryables, and the timers of health, settings."""
        robot, bus = self.config.robot.id, self.bus
        bus.live(keys.live_key(robot, self.name, f"{bus.boot:x}"))
        # Encoded once, so that a flood of queries costs little.
        schema = msgspec.json.encode(keys.schemas({each.topic for each in bus.publishers}))
        settings = msgspec.json.encode(self._settings.settings)
        parts = {"schema": lambda: schema, "config": lambda: settings, "last": self._last}
        for part, make in parts.items():
            bus.answer(keys.info_key(robot, self.name, part), make, "application/json")
        self.loop.every(1.0, self._report)
        self.loop.every(1.0, self._publish_settings)

    def _answer_queries(self) -> None:
        for bus in self.buses:
            bus.answer_queries()

    def _report(self, now_ns: int) -> None:
        counts = sum((bus.counts for bus in self.buses), Counter[str]())
        past_s = (now_ns - self._reported_ns) / NS_PER_S
        rates = {key: (n - self._counted[key]) / past_s for key, n in sorted(counts.items())}
        self._counted, self._reported_ns = counts, now_ns
        self._health.put(
            Health(
                service=self.name,
                version=VERSION,
                uptime=(now_ns - self._started_ns) / NS_PER_S,
                rates=rates,
                counters=dict(sum((bus.counters for bus in self.buses), self.counters)),
                lateness=self.loop.take_lateness_s(),
                rss=resident_bytes(),
                priority=realtime.priority(),
                reactions=self.reactions(),
            )
        )

    def _publish_settings(self, now_ns: int) -> None:
        """Publish them once there is a subscriber, so that a recording begins with them."""
        if not self._settings_to.passed_on:
            self._settings_due_ns = None
        elif self._settings_due_ns is None or now_ns >= self._settings_due_ns:
            self._settings_due_ns = now_ns + round(SETTINGS_PERIOD_S * NS_PER_S)
            self._settings_to.put(self._settings)

    def _last(self) -> bytes:
        return msgspec.json.encode({p.key: p.last for p in self.bus.publishers if p.last})


def run(
    name: str,
    root: type[C],
    build: Callable[[Node[C]], object],
    argv: Sequence[str] | None = None,
    *,
    priority: int = 0,
) -> int:
    """Run a service; return its exit code. ``priority`` is one of ``realtime``'s."""
    return run_with(name, root, build, sources(arguments(name).parse_args(argv)), priority)


def run_with(
    name: str,
    root: type[C],
    build: Callable[[Node[C]], object],
    settings: Sources,
    priority: int = 0,
) -> int:
    """Run a service with these sources of settings; return its exit code."""
    try:
        loaded = load(root, settings)
        if priority and loaded.config.host.realtime:
            realtime.request(priority)  # before threads start: they inherit it
            realtime.limit()
            realtime.share_cpu()
        log.configure(loaded.config.log, name)
        node = Node(name, loaded)
    except ConfigError as error:
        print(f"{name}: {error}", file=sys.stderr)  # noqa: T201 - whatever the log's format
        return EXIT_CONFIG
    try:
        build(node)
    except (LinkError, ConfigError) as error:
        node.log.error(str(error))
        return EXIT_LINK if isinstance(error, LinkError) else EXIT_CONFIG
    node.announce()
    return serve(node)


def run_optional_service(
    name: str,
    root: type[C],
    builder: str,
    settings: Sources,
    *,
    extra: str,
) -> int:
    """Run a service that needs an extra, at lower priority than the control chain.

    ``builder`` is the path of its class, which only this process imports.
    """
    module, _, attribute = builder.rpartition(".")
    try:
        with needs_extra(extra, name):
            build = getattr(import_module(module), attribute)
    except T2Error as error:
        print(error, file=sys.stderr)  # noqa: T201 - logs are not set up yet
        return EXIT_CONFIG
    os.nice(NICENESS)
    return run_with(name, root, build, settings)


def serve(node: Node[C]) -> int:
    """Run the loop until a signal, stop the service in order, and exit."""
    stop_on_signals(node)
    systemd = Systemd()
    if systemd.enabled:
        node.loop.every(CHECK_PERIOD_S, systemd.ready)
    try:
        node.open()
        node.log.info("started", robot=node.config.robot.id)
        node.loop.run()
        node.log.info("stopping")
        systemd.stopping()
        _await_stop(node)
    finally:
        run_exit_actions(node)
        # Also after a crash: an open session keeps a failed process from ending.
        node.close()
    node.log.info("stopped")
    return 0


def _await_stop(node: Node[C]) -> None:
    deadline_ns = clock.now_ns() + round(STOP_TIMEOUT_S * NS_PER_S)

    def check(now_ns: int) -> None:
        if node.is_stopped() or now_ns > deadline_ns:
            node.loop.stop()

    node.loop.every(0.02, check)
    node.loop.run()


def resident_bytes() -> int:
    """Return the resident memory of this process, 0 where the system does not report it."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except OSError:
        return 0
    return pages * os.sysconf("SC_PAGE_SIZE")


def stop_on_signals(node: Node[C]) -> None:
    """Stop the loop at the first SIGINT or SIGTERM; at the second one run the actions and exit."""
    signals = count(1)

    def handle(number: int, _: FrameType | None) -> None:
        if next(signals) == 1:  # the second one may arrive while this handler runs
            node.loop.stop()
            return
        try:
            run_exit_actions(node)
        finally:
            os._exit(128 + number)

    _on_signals(handle)


def run_exit_actions(node: Node[C]) -> None:
    """Run the exit actions; a signal changes nothing meanwhile, and ends the process afterwards."""
    _on_signals(signal.SIG_IGN)
    try:
        node.on_exit()
    finally:
        _on_signals(signal.SIG_DFL)


def _on_signals(handler: Callable[[int, FrameType | None], None] | signal.Handlers) -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, handler)
