"""Bridge, safety and odometry in this process: no core is ever entered by two threads at once.

Zenoh's threads handle samples in place. Every entry of a core asserts that its thread holds the
lock of a loop, and that no other thread is inside that core.
"""

import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import wraps
from inspect import isfunction
from typing import Any

import pytest

from common import keys
from common import messages as m
from common.bus.bus import Arrival, Bus
from common.config import Sources, load
from common.loop import Loop
from common.operator import reset_request
from common.service import Node
from services.bridge.bridge import Bridge
from services.bridge.config import BridgeConfig
from services.bridge.core import Core
from services.bridge.motion_output import MotionOutput
from services.bridge.operator import Operator
from services.odom.config import OdomConfig
from services.odom.core.estimator import Estimator
from services.odom.odometer import Odometer
from services.safety.config import SafetyConfig
from services.safety.policy import Policy
from services.safety.service import SafetyService
from verification.harness.bus import bus_on, running
from verification.harness.fake_board import Board, board
from verification.harness.waiting import wait_until

pytestmark = pytest.mark.timed

CORES: tuple[type, ...] = (Core, MotionOutput, Operator, Policy, Estimator)
LASTS_S = 4.0


class Entries:
    """The entries of all cores: how many, by which threads, and those that were wrong."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.loops: list[Loop] = []
        self.wrong: list[str] = []
        self.threads: dict[str, set[int]] = {core.__name__: set() for core in CORES}
        self.counts: Counter[str] = Counter()
        self._inside: dict[int, int] = {}  # the thread inside, by core
        for core in CORES:
            for name, method in list(vars(core).items()):
                if isfunction(method) and not name.startswith("_"):
                    patch.setattr(core, name, self._watched(core.__name__, method))

    def _watched(self, core: str, method: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(method)
        def entry(self_: object, *args: object, **named: object) -> object:
            here, outer = threading.get_ident(), self._inside.get(id(self_))
            if not any(loop.held for loop in self.loops):
                self.wrong.append(f"{core}.{method.__name__} without a loop's lock")
            if outer not in (None, here):
                self.wrong.append(f"{core}.{method.__name__} in two threads")
            self.threads[core].add(here)
            self.counts[core] += 1
            self._inside[id(self_)] = here
            try:
                return method(self_, *args, **named)
            finally:
                if outer is None:
                    del self._inside[id(self_)]

        return entry


def node_of(name: str, config: type[Any], endpoint: str, made: Board) -> Node[Any]:
    sets = [
        f"bus.connect={endpoint}",
        f"board.port={made.address[1]}",
        f"board.listen_ports={made.ports}",
    ]
    return Node(name, load(config, Sources(environ={}, sets=sets)), in_place=True)


@contextmanager
def services(endpoint: str, made: Board, entries: Entries) -> Iterator[None]:
    nodes = [
        node_of(name, config, endpoint, made)
        for name, config in (
            ("bridge", BridgeConfig),
            ("safety", SafetyConfig),
            ("odom", OdomConfig),
        )
    ]
    entries.loops += [node.loop for node in nodes]
    bridge, safety, odom = nodes
    estop_bus = safety.open_bus()
    shell = Bridge(bridge)
    SafetyService(safety, estop_bus)
    Odometer(odom)
    with ExitStack() as stack:
        for node in nodes:
            node.announce()
            stack.enter_context(running(node.loop))
        for bus in (bridge.bus, safety.bus, estop_bus, odom.bus):
            bus.open()
        yield
        for node, buses in ((odom, ()), (safety, (estop_bus,)), (bridge, ())):
            closed = threading.Event()
            for bus in (*buses, node.bus):
                node.loop.post(bus.close)
            node.loop.post(closed.set)
            wait_until(closed.is_set, f"the closed sessions of {node.name}")
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


def test_no_core_is_entered_by_two_threads(endpoint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    entries, crowd = Entries(monkeypatch), Crowd()
    with (
        board() as made,
        services(endpoint, made, entries),
        running(Loop()) as loop,
        bus_on(endpoint, loop, crowd.declare),
    ):
        wait_until(lambda: crowd.state is not None, "safety")
        with crowd.at_work(made):
            wait_until(lambda: crowd.driven["odometry"] and crowd.driven["call"], "all at work")
            time.sleep(LASTS_S)
    assert entries.wrong == []
    for core in (Core, Policy, Estimator):
        name = core.__name__
        assert entries.counts[name] > 100, name
        assert len(entries.threads[name]) > 1, f"{name}: nothing was handled in place"
