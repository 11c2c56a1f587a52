"""A service's life: arguments, settings, logs, signals, presence, health, the loop, the end.

``run`` reads the settings (exit code 78 names what is wrong, before anything opens), builds the
service around a ``Node``, and serves until SIGINT or SIGTERM. The first signal lets the service
come to rest; a second one ends the process at once. The exit actions run once on every way out: a
signal that arrives while they run changes nothing.
"""

import os
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from types import FrameType
from typing import Generic, TypeVar

import msgspec

from common import keys, log, realtime
from common.bus.bus import Bus
from common.bus.drive import DriveLink, LinkWatch
from common.cli_args import EXIT_CONFIG, EXIT_LINK, arguments, sources
from common.config import Loaded, load
from common.errors import ConfigError, LinkError
from common.freshness import NS_PER_S
from common.loop import Loop
from common.messages import Event, Health, Level, Timing
from common.schema import schemas
from common.settings import Shared
from common.systemd import OFTEN_S, Systemd
from common.version import VERSION

REST_S = 2.0  # how long a service may take to come to rest
BEHIND = 10  # how nice a service is that does not drive


C = TypeVar("C", bound=Shared)


class Node(Generic[C]):
    """What a service is built on: its settings, its loop, its bus, its events and counters."""

    drive: DriveLink  # of bridge and safety, see ``open_drive``

    def __init__(self, name: str, loaded: Loaded[C]) -> None:
        self.name = name
        self.config: C = loaded.config
        self.loop = Loop()
        self.log = log.Logger()
        self.bus = self.open_bus()
        self.counters: Counter[str] = Counter()
        self.is_stopped: Callable[[], bool] = lambda: True  # asked while stopping
        self.on_exit: Callable[[], None] = lambda: None  # on every way out, a crash too
        self.timing: Callable[[], Timing | None] = lambda: None  # what goes into the health
        self._loaded = loaded
        self._events = self.bus.publisher(keys.EVENTS, service=name)
        self._health = self.bus.publisher(keys.HEALTH, service=name)
        self._started_ns = self._reported_ns = time.monotonic_ns()
        self._counted: Counter[str] = Counter()

    def open_bus(self) -> Bus:
        """Return a bus of its own session, not yet open; the first one is ``bus``."""
        return Bus(self.config.bus, self.config.robot.id, self.loop.post)

    def open_drive(self, *, listens: bool) -> DriveLink:
        """Make this service's end of the drive link, which opens and closes with ``bus``."""
        self.drive = DriveLink(self.bus, listens=listens)
        self.loop.every(1.0, LinkWatch(self.drive, self.event).look)
        return self.drive

    def event(self, name: str, level: Level, text: str, **about: str | float | bool | None) -> None:
        """Publish and log a transition."""
        self._events.put(Event(name=name, level=level, text=text, about=about))
        getattr(self.log, level)(text, event_name=name, **about)

    def present(self) -> None:
        """Say on the bus that the service is there, and answer what a newcomer asks."""
        robot, bus = self.config.robot.id, self.bus
        bus.live(keys.live_key(robot, self.name, f"{bus.boot:x}"))
        for part, make in (
            ("schema", self._schema),
            ("config", self._settings),
            ("last", self._last),
        ):
            bus.answer(keys.info_key(robot, self.name, part), make, "application/json")
        self.loop.every(1.0, self._report)

    def _report(self, now_ns: int) -> None:
        counts = Counter(self.bus.counts)
        past_s = (now_ns - self._reported_ns) / NS_PER_S
        rates = {key: (n - self._counted[key]) / past_s for key, n in sorted(counts.items())}
        self._counted, self._reported_ns = counts, now_ns
        self._health.put(
            Health(
                service=self.name,
                version=VERSION,
                uptime=(now_ns - self._started_ns) / NS_PER_S,
                rates=rates,
                counters=dict(self.bus.counters + self.counters),
                lateness=self.loop.take_lateness_s(),
                rss=resident_bytes(),
                priority=realtime.priority(),
                timing=self.timing(),
            )
        )

    def _schema(self) -> bytes:
        mine = {publisher.topic for publisher in self.bus.publishers}
        return msgspec.json.encode(schemas(mine))

    def _settings(self) -> bytes:
        settings = {
            path: {"value": setting.value, "origin": setting.origin}
            for path, setting in self._loaded.settings.items()
        }
        return msgspec.json.encode(settings)

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
    """Live a service's life and return its exit code; a ``priority`` is one of ``realtime``'s."""
    try:
        loaded = load(root, sources(arguments(name).parse_args(argv)))
        if priority and loaded.config.robot.realtime:
            realtime.ask(priority)  # before there are threads: they follow it
            realtime.limit()
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
    node.present()
    return serve(node)


def run_optional_service(
    name: str,
    root: type[C],
    found: Callable[[], Callable[[Node[C]], object]],
    argv: Sequence[str] | None = None,
    *,
    extra: str,
) -> int:
    """Live the life of a service that needs an extra and stands behind all that drives.

    ``found`` imports what builds the service.
    """
    try:
        build = found()
    except ModuleNotFoundError as error:
        print(  # noqa: T201 - logs are not set up yet
            f"{name} needs {error.name}: install the extra `{extra}` (pip install -e '.[{extra}]')",
            file=sys.stderr,
        )
        return EXIT_CONFIG
    os.nice(BEHIND)
    return run(name, root, build, argv)


def serve(node: Node[C]) -> int:
    """Run the loop until a signal, let the service come to rest, and leave."""
    exit_actions = ExitActions(node)
    _on_signal(node, exit_actions)
    systemd = Systemd()
    if systemd.listens:
        node.loop.every(OFTEN_S, systemd.ready)
    try:
        node.bus.open()
        node.log.info("started", robot=node.config.robot.id)
        node.loop.run()
        node.log.info("stopping")
        systemd.stopping()
        _come_to_rest(node)
    finally:
        exit_actions.run()
        # After a bug of ours too: an open session keeps a process that has failed from ending.
        node.bus.close()
        node.loop.close()
    node.log.info("stopped")
    return 0


def _come_to_rest(node: Node[C]) -> None:
    deadline_ns = time.monotonic_ns() + round(REST_S * NS_PER_S)

    def check(now_ns: int) -> None:
        if node.is_stopped() or now_ns > deadline_ns:
            node.loop.stop()

    node.loop.every(0.02, check)
    node.loop.run()


def resident_bytes() -> int:
    """Return the resident memory of this process, 0 where the system does not tell."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except OSError:
        return 0
    return pages * os.sysconf("SC_PAGE_SIZE")


class ExitActions:
    """The exit actions of a service, run once."""

    def __init__(self, node: Node[C]) -> None:
        self._node = node
        self._begun = self._over = False

    @property
    def under_way(self) -> bool:
        """Whether they have begun and are not over."""
        return self._begun and not self._over

    def run(self) -> None:
        """Run them, unless they ran or are running."""
        if self._begun:
            return
        self._begun = True
        try:
            self._node.on_exit()
        finally:
            self._over = True


def _on_signal(node: Node[C], exit_actions: ExitActions) -> None:
    def stop(number: int, _: FrameType | None) -> None:
        for name in (signal.SIGINT, signal.SIGTERM):
            signal.signal(name, leave)
        node.loop.stop()

    def leave(number: int, _: FrameType | None) -> None:
        if exit_actions.under_way:
            return  # the interrupted call ends the process
        try:
            exit_actions.run()
        finally:
            os._exit(128 + number)

    for name in (signal.SIGINT, signal.SIGTERM):
        signal.signal(name, stop)
