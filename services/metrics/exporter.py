"""The exporter on the bus: hears the robots, says nothing of them, and answers Prometheus.

Prometheus asks in a thread of the web server's. What it is told is made in the node's loop: a loop
that hangs gives no answer, and so never an old one.
"""

import time
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from pathlib import Path
from typing import TypeVar
from wsgiref.simple_server import WSGIServer

from prometheus_client import CollectorRegistry, start_http_server
from prometheus_client.core import Metric
from prometheus_client.registry import Collector

from common import keys, members
from common import messages as m
from common.bus.bus import Arrival, Bus
from common.errors import ConfigError, LinkError
from common.freshness import Latest
from common.service import Node
from services.metrics.certificates import ends
from services.metrics.config import Metrics, MetricsConfig
from services.metrics.robot import Robot, prune
from services.metrics.samples import sheet

DEPTH = 2000  # samples of all robots that may wait, of one stream
PATIENCE_S = 2.0  # for the loop's answer; Prometheus waits for 10 s
LOOK_S = 60.0  # between two looks for who is long gone, and at the list of members


class Exporter(Collector):
    """The shell around what was heard."""

    def __init__(self, node: Node[MetricsConfig]) -> None:
        settings, own = node.config.metrics, node.config.robot.id
        self._node = node
        self._robots: dict[str, Robot] = {}
        if settings.robots in ("", own):
            self._own, self._bus = own, node.bus
            self._robots[own] = Robot()  # told of although it was never heard
        else:
            self._own = ""
            self._bus = Bus(node.config.bus, settings.robots, node.loop.post)
            self._bus.open()
        self._certificates: dict[tuple[str, str], float] = {}
        self._listen()
        node.loop.every(LOOK_S, self._forget)
        if node.config.bus.members:
            node.loop.every(LOOK_S, lambda _: self._read(Path(node.config.bus.members)))
        self._server = served(settings, self)
        node.on_exit = self._close

    def _listen(self) -> None:
        bus = self._bus
        bus.subscribe(keys.SAFETY, self._on_safety, depth=DEPTH)
        bus.subscribe(keys.LINK, self._on_link, depth=DEPTH)
        bus.subscribe(keys.ODOMETRY, self._on_odometry, depth=DEPTH)
        bus.subscribe(keys.HEALTH, self._on_health, depth=DEPTH, service="*")
        bus.subscribe(keys.EVENTS, self._on_event, depth=DEPTH, service="*")
        bus.watch_live(keys.live_key(bus.robot, "*", "*"), self._on_live)

    def _on_safety(self, arrival: Arrival[m.SafetyState]) -> None:
        self._robot(arrival.key).safety = Latest(arrival.message, arrival.received_ns)

    def _on_link(self, arrival: Arrival[m.Link]) -> None:
        self._robot(arrival.key).link = Latest(arrival.message, arrival.received_ns)

    def _on_odometry(self, arrival: Arrival[m.Odometry]) -> None:
        self._robot(arrival.key).odometry = Latest(arrival.message, arrival.received_ns)

    def _on_health(self, arrival: Arrival[m.Health]) -> None:
        service = arrival.key.split("/")[-2]
        self._robot(arrival.key).on_health(service, arrival.message, arrival.received_ns)

    def _on_event(self, arrival: Arrival[m.Event]) -> None:
        self._robot(arrival.key).on_event(arrival.key.split("/")[-1], arrival.message)

    def _on_live(self, key: str, alive: bool) -> None:
        service, instance = key.split("/")[-2:]
        self._robot(key).on_live(service, instance, alive, time.monotonic_ns())

    def _robot(self, key: str) -> Robot:
        return self._robots.setdefault(key.split("/")[2], Robot())

    def _forget(self, now_ns: int) -> None:
        prune(self._robots, self._own, now_ns)

    def _read(self, file: Path) -> None:
        """Look when certificates end; a list that cannot be read tells nothing of them."""
        try:
            self._certificates = ends(members.read(file))
        except ConfigError as error:
            self._certificates = {}
            self._node.counters["members_unreadable"] += 1
            self._node.log.warning("no list of members", reason=str(error))

    def _sheet(self) -> list[Metric]:
        return sheet(
            {n: robot for n, robot in self._robots.items() if n == self._own or robot.is_robot},
            time.monotonic_ns(),
            connected=self._bus.connected,
            certificates=self._certificates,
        )

    def collect(self) -> Iterable[Metric]:
        """Return what is known, in the web server's thread; raise ``TimeoutError``."""
        return asked(self._node.loop.post, self._sheet)

    def _close(self) -> None:
        self._server.shutdown()
        if self._bus is not self._node.bus:
            self._bus.close()


A = TypeVar("A")


def asked(post: Callable[[Callable[[], None]], None], make: Callable[[], A]) -> A:
    """Let the loop make it, and wait for that; raise ``TimeoutError`` when it does not."""
    answer: Future[A] = Future()
    post(lambda: answer.set_result(make()))
    return answer.result(PATIENCE_S)


def served(settings: Metrics, collector: Collector) -> WSGIServer:
    """Begin to answer; raise ``LinkError`` when the port is taken."""
    registry = CollectorRegistry()
    registry.register(collector)
    try:
        server, _ = start_http_server(settings.port, settings.host, registry)
    except OSError as error:
        raise LinkError(
            f"metrics cannot listen on {settings.host}:{settings.port}: {error.strerror}"
        ) from None
    return server
