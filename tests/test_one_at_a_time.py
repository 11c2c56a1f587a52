"""Bridge, safety and odometry in this process: each core is entered by its loop's thread alone."""

import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from inspect import isfunction
from typing import Any

import pytest

from common import keys
from common import messages as m
from common.bus.bus import Arrival, Bus
from common.client import reset_request
from common.config import Sources, load
from common.loop import Loop
from common.service import Node
from services.bridge.bridge import Bridge
from services.bridge.config import BridgeConfig
from services.bridge.core.calls import Calls
from services.bridge.core.core import Core
from services.bridge.core.motion_output import MotionOutput
from services.odom.config import OdomConfig
from services.odom.core.estimator import Estimator
from services.odom.odometer import Odometer
from services.safety.config import SafetyConfig
from services.safety.core.policy import Policy
from services.safety.service import SafetyService
from verification.harness.bus import bus_on, running
from verification.harness.fake_board import Board, board
from verification.harness.waiting import wait_until

pytestmark = pytest.mark.timed

CORES: dict[type, str] = {
    Core: "bridge", MotionOutput: "bridge", Calls: "bridge", Policy: "safety", Estimator: "odom",
}  # fmt: skip
LASTS_S = 4.0


class Entries:
    """The entries of all cores: how many, and by which threads."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.threads: dict[str, set[str]] = {core.__name__: set() for core in CORES}
        self.counts: Counter[str] = Counter()
        for core in CORES:
            for name, method in list(vars(core).items()):
                if isfunction(method) and not name.startswith("_"):
                    patch.setattr(core, name, self._watched(core.__name__, method))

    def _watched(self, core: str, method: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(method)
        def entry(*args: object, **named: object) -> object:
            self.threads[core].add(threading.current_thread().name)
            self.counts[core] += 1
            return method(*args, **named)

        return entry


def node_of(name: str, config: type[Any], endpoint: str, made: Board) -> Node[Any]:
    sets = [
        f"bus.connect={endpoint}",
        f"board.port={made.address[1]}",
        f"board.listen_ports={made.ports}",
    ]
    return Node(name, load(config, Sources(environ={}, sets=sets)))


@contextmanager
def services(endpoint: str, made: Board) -> Iterator[None]:
    bridge = node_of("bridge", BridgeConfig, endpoint, made)
    safety = node_of("safety", SafetyConfig, endpoint, made)
    odom = node_of("odom", OdomConfig, endpoint, made)
    shell = Bridge(bridge)
    SafetyService(safety, safety.open_bus())
    Odometer(odom)
    nodes = (bridge, safety, odom)
    threads = [threading.Thread(target=node.loop.run, name=node.name) for node in nodes]
    for node, thread in zip(nodes, threads, strict=True):
        node.announce()
        thread.start()
        node.open()
    yield
    for node, thread in reversed(list(zip(nodes, threads, strict=True))):
        node.loop.stop()
        thread.join()
        node.close()
    shell._sockets.close()


class Crowd:
    """Sources and operators that all want something at once."""

    def __init__(self) -> None:
        self.state: m.SafetyState | None = None
        self.driven: Counter[str] = Counter()
        self._ended = threading.Event()

    def declare(self, bus: Bus) -> None:
        self._bus = bus
        names = ("teleop", "nav", "web")
        self._drives = {name: bus.publisher(keys.DRIVE, source=name) for name in names}
        bus.subscribe(keys.SAFETY, self._on_state)
        bus.subscribe(keys.VELOCITY, lambda _: self.driven.update(("velocity",)))
        bus.subscribe(keys.ODOMETRY, lambda _: self.driven.update(("odometry",)))

    def _on_state(self, arrival: Arrival[m.SafetyState]) -> None:
        self.state = arrival.message

    def source(self, name: str) -> None:
        while not self._ended.is_set():
            echo = self.state.heartbeat if self.state else 0
            self._drives[name].put(m.Drive(linear=0.2, angular=0.1, echo=echo))
            time.sleep(0.004)

    def operator(self) -> None:
        while not self._ended.is_set():
            if (state := self.state) is not None:
                calls: list[tuple[Any, Any]] = [
                    (keys.RESET, reset_request(state)),
                    (keys.SET_POSE, m.PoseRequest(x=0.0, y=0.0, heading=0.0, echo=state.heartbeat)),
                    (keys.SET_LED, m.LedRequest(channel=1, mode=1)),
                ]
                for call, request in calls:
                    self._bus.call(call, request, self._on_answer, lambda _: None)
            time.sleep(0.03)

    def _on_answer(self, _: object) -> None:
        self.driven["call"] += 1

    def finger(self, made: Board) -> None:
        while not self._ended.is_set():
            made.pressed = not made.pressed
            time.sleep(0.15)
            self._bus.estop()

    @contextmanager
    def at_work(self, made: Board) -> Iterator[None]:
        works: list[tuple[Callable[..., None], tuple[object, ...]]] = [
            *((self.source, (name,)) for name in self._drives),
            (self.operator, ()),
            (self.finger, (made,)),
        ]
        threads = [threading.Thread(target=work, args=args) for work, args in works]
        for thread in threads:
            thread.start()
        try:
            yield
        finally:
            self._ended.set()
            for thread in threads:
                thread.join()


def test_each_core_is_entered_by_its_loop_alone(
    endpoint: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    entries, crowd = Entries(monkeypatch), Crowd()
    with (
        board() as made,
        services(endpoint, made),
        running(Loop()) as loop,
        bus_on(endpoint, loop, crowd.declare),
    ):
        entries.threads = {core.__name__: set() for core in CORES}  # construction is over
        wait_until(lambda: crowd.state is not None, "safety")
        with crowd.at_work(made):
            wait_until(lambda: crowd.driven["odometry"] and crowd.driven["call"], "all at work")
            time.sleep(LASTS_S)
    assert entries.threads == {core.__name__: {owner} for core, owner in CORES.items()}
    assert min(entries.counts[core.__name__] for core in (Core, Policy, Estimator)) > 100
