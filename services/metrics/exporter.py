"""The exporter's shell: subscribes to the robots and answers Prometheus.

The web server handles a scrape in its own thread and lets the node's loop make the samples. If the
loop hangs, the scrape fails; it never returns old values.
"""

from collections.abc import Iterable
from concurrent.futures import Future
from typing import Any

from prometheus_client import CollectorRegistry, start_http_server
from prometheus_client.core import Metric
from prometheus_client.registry import Collector

from common import clock
from common.bus.bus import Arrival, Bus
from common.service import Node
from services.metrics.config import MetricsConfig
from services.metrics.robot import RobotState, prune
from services.metrics.samples import STREAMS, metric_families
from t2 import keys
from t2 import messages as m
from t2.errors import LinkError

HOST = "127.0.0.1"  # without authentication: Prometheus runs here, the bus crosses the network
DEPTH = 2000  # pending samples of one stream, for all robots
PATIENCE_S = 2.0  # for the loop; Prometheus waits 10 s
CHECK_S = 60.0  # between two checks for expired robots


class Exporter(Collector):
    """Connects the bus, the states of the robots and the web server."""

    def __init__(self, node: Node[MetricsConfig]) -> None:
        settings, own = node.config.metrics, node.config.robot.id
        self._node = node
        self._robots: dict[str, RobotState] = {}
        if settings.robots in ("", own):
            self._own, self._bus = own, node.bus
            self._robots[own] = RobotState()  # exported even if never seen
        else:
            self._own = ""
            self._bus = Bus(node.config.bus, settings.robots, node.loop.post)
            self._bus.open()
        self._subscribe()
        node.loop.every(CHECK_S, lambda now_ns: prune(self._robots, self._own, now_ns))
        registry = CollectorRegistry()
        registry.register(self)
        try:
            self._server = start_http_server(settings.port, HOST, registry)[0]
        except OSError as error:
            raise LinkError(
                f"metrics cannot listen on {HOST}:{settings.port}: {error.strerror}"
            ) from None
        node.on_exit = self._close

    def _subscribe(self) -> None:
        bus = self._bus
        for topic in STREAMS.values():
            bus.subscribe(topic, self._on_message, depth=DEPTH)
        bus.subscribe(keys.HEALTH, self._on_message, depth=DEPTH, service="*")
        bus.subscribe(keys.EVENTS, self._on_event, depth=DEPTH, service="*")
        bus.watch_live(keys.live_key(bus.robot, "*", "*"), self._on_live)

    def _on_message(self, arrival: Arrival[Any]) -> None:
        path = arrival.key.split("/", 3)[3]
        self._robot(arrival.key).on_message(path, arrival.message, arrival.received_ns)

    def _on_event(self, arrival: Arrival[m.Event]) -> None:
        self._robot(arrival.key).on_event(arrival.key.split("/")[-1], arrival.message)

    def _on_live(self, key: str, alive: bool) -> None:
        service, instance = key.split("/")[-2:]
        self._robot(key).on_live(service, instance, alive, clock.now_ns())

    def _robot(self, key: str) -> RobotState:
        return self._robots.setdefault(key.split("/")[2], RobotState())

    def _families(self) -> list[Metric]:
        return metric_families(
            {n: robot for n, robot in self._robots.items() if n == self._own or robot.is_robot},
            clock.now_ns(),
            connected=self._bus.connected,
        )

    def collect(self) -> Iterable[Metric]:
        """Return the families, in the web server's thread; raise ``TimeoutError``."""
        answer: Future[list[Metric]] = Future()
        self._node.loop.post(lambda: answer.set_result(self._families()))
        return answer.result(PATIENCE_S)

    def _close(self) -> None:
        self._server.shutdown()
        if self._bus is not self._node.bus:
            self._bus.close()
