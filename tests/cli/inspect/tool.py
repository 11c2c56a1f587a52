"""``t2`` in this process, and simulated services."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

from cli.__main__ import main
from common.bus.bus import Bus
from t2 import keys
from t2.keys import Topic
from t2.messages import Message, SafetyState
from tests.common.bus_fixture import BusFixture
from tests.factories import safety_state


@dataclass(frozen=True)
class Result:
    """Exit code and output of a command."""

    code: int
    out: str
    err: str

    @property
    def lines(self) -> list[Any]:
        """Parse the output as JSON lines."""
        return [json.loads(line) for line in self.out.splitlines()]


@dataclass(frozen=True)
class Tool:
    """Runs ``t2`` on one robot; an empty name leaves the robot to the arguments."""

    endpoint: str
    robot: str
    capsys: pytest.CaptureFixture[str]

    def __call__(self, *words: str, robot: str | None = None, text: bool = False) -> Result:
        """Run it to its end, with JSON output unless ``text`` is set."""
        named = robot or self.robot
        where = ("--set", f"bus.connect={self.endpoint}", *(("--robot", named) if named else ()))
        self.capsys.readouterr()
        try:
            code = main([*words, *(() if text else ("--json",)), *where])
        except SystemExit as end:  # invalid arguments
            code = int(str(end.code))
        captured = self.capsys.readouterr()
        return Result(code, captured.out, captured.err)


def pretend(
    buses: BusFixture,
    name: str,
    streams: dict[Topic[Any], Callable[[], Message]],
    declare: Callable[[Bus], object] = lambda _: None,
    hz: float = 50.0,
    **names: str,
) -> Bus:
    """Start a simulated service that publishes these messages periodically."""
    publishers: list[tuple[Any, Callable[[], Message]]] = []

    def everything(bus: Bus) -> None:
        bus.live(keys.live_key(buses.robot, name, f"{bus.boot:x}"))
        for topic, make in streams.items():
            publishers.append((bus.publisher(topic, **names), make))
        declare(bus)

    def put(_: int) -> None:
        for publisher, make in publishers:
            publisher.put(make())

    bus = buses.bus(everything)
    buses.loop.post(lambda: buses.loop.every(1 / hz, put))
    return bus


class FakeSafety:
    """A safety service with these fields of its state, whose heartbeat rises.

    It latches an emergency stop if it ``obeys``.
    """

    def __init__(
        self,
        buses: BusFixture,
        declare: Callable[[Bus], object] = lambda _: None,
        obeys: bool = True,
        **fields: Any,
    ) -> None:
        self.stops: list[int] = []
        self.heartbeat = 100
        self.fields = fields
        self._obeys = obeys

        def everything(bus: Bus) -> None:
            bus.on_any(keys.estop_key(bus.robot), self.stops.append)
            bus.on_any(keys.DRIVE.on(bus.robot, source="web"), lambda _: None)
            declare(bus)

        self.bus = pretend(buses, "safety", {keys.SAFETY: self.state}, everything)

    def state(self) -> SafetyState:
        self.heartbeat += 1
        stopped = {"latched": ("estop",)} if self.stops and self._obeys else {}
        return safety_state(heartbeat=self.heartbeat, **self.fields | stopped)
