"""The testbed of a scenario: a board, a stack and bus clients."""

import contextlib
import time
import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import zenoh

from verification.outside import wire
from verification.outside.board import Board, Faults
from verification.outside.clients import LINK, STATE, Observer, Operator, Source, session
from verification.outside.stack import Stack, free_port, wait_for
from verification.outside.vehicle import Motors

UP_S = 20.0


class NotMeasuredError(Exception):
    """A precondition of the scenario was not met."""


@dataclass(frozen=True)
class Result:
    """What a scenario measured, and whether it is as expected."""

    measured: str
    ok: bool


@dataclass
class Testbed:
    """Access of a scenario to board, stack and clients."""

    board: Board
    stack: Stack
    bus: "zenoh.Session"
    observer: Observer
    operator: Operator

    def arm(self, seconds: float) -> None:
        """Wait until the bridge and safety are ready to drive."""
        last = self.observer.last
        self.wait(lambda: last(LINK)["armed"], seconds, "bridge not armed")
        self.wait(lambda: last(STATE)["verdict"] != "inhibited", seconds, "inhibited")
        time.sleep(0.6)  # safety needs good inputs for 0.5 s before a neutral request

    @contextlib.contextmanager
    def source(self, name: str = "teleop") -> Iterator[Source]:
        """Return a source of motion that has made its neutral request."""
        with Source(self.bus, self.observer, name) as source:
            source.request(0.0)
            time.sleep(0.3)
            yield source

    def speed(self) -> float:
        return self.board.vehicle.linear

    def wait(self, true: Callable[[], object], seconds: float, what: str) -> None:
        """Wait for a precondition; end the scenario after a timeout."""
        if not wait_for(true, seconds):
            text = self.observer.last(STATE).get("text", "no state of safety")
            waiting = self.observer.last(LINK).get("waiting", "no link")
            raise NotMeasuredError(f"{what}: {text}; {waiting}".rstrip("; "))

    def drive(self, source: Source, linear: float, angular: float = 0.0) -> None:
        """Request a motion until the vehicle reaches it."""
        source.request(linear, angular)
        vehicle = self.board.vehicle

        def moves() -> bool:
            return abs(vehicle.linear - linear) < 0.02 and abs(vehicle.angular - angular) < 0.04

        self.wait(moves, 8.0, f"not driven at {linear} m/s, {angular} rad/s")

    def halt(self, source: Source) -> None:
        """Release the controls, and wait for standstill."""
        source.silence()
        vehicle = self.board.vehicle
        self.wait(lambda: not (vehicle.linear or vehicle.angular), 4.0, "does not stand")

    def contact(self, byte: int = 1, seconds: float = 0.0) -> float:
        """Press the bumper, wait for the latch, and return when it was pressed."""
        at = time.monotonic()
        self.board.bumper = byte
        self.wait(lambda: "contact" in self.observer.latched, 2.0, "no contact is latched")
        time.sleep(seconds)
        return at

    def first(self, kind: str, since: float, seconds: float) -> float | None:
        """Return the time until the board received a command of this kind, in s."""
        end = since + seconds
        while True:
            found = [c.at - since for c in self.board.since(since) if c.kind == kind]
            if found or time.monotonic() > end:
                return found[0] if found else None
            time.sleep(0.01)

    def runs(self, since: float, sign: int = 0) -> list[wire.Command]:
        """Return the RUN frames that move, in a direction or in any."""
        moving = [command for command in self.board.since(since) if command.moves]
        return [c for c in moving if not sign or c.linear * sign > 0]


Prepare = Callable[[Board], object]  # of a board, before it starts


def fitted(motors: Motors, brake: float = 5.0) -> Prepare:
    """Return the preparation of a vehicle with these motors; brake: m/s^2, of BRAKE."""

    def prepare(board: Board) -> None:
        board.vehicle.motors, board.vehicle.brake = motors, brake

    return prepare


@dataclass(frozen=True)
class Scenario:
    """A situation, and what is expected of every tree in it."""

    line: int
    name: str
    expected: str
    run: Callable[[Testbed], Result]
    sets: Sequence[str] = ()
    sets_if_known: Sequence[str] = ()  # all of them where the tree's config knows the first
    faults: Callable[[], Faults] = Faults
    prepare: Prepare = lambda board: None
    armed: bool = True  # whether the bridge has to arm before it begins
    supervised: bool = False  # whether `t2 up` starts the services


SCENARIOS: list[Scenario] = []
Run = Callable[[Testbed], Result]


def scenario(
    line: int,
    name: str,
    expected: str,
    *,
    sets: Sequence[str] = (),
    sets_if_known: Sequence[str] = (),
    faults: Callable[[], Faults] = Faults,
    prepare: Prepare = lambda board: None,
    armed: bool = True,
    supervised: bool = False,
) -> Callable[[Run], Run]:
    """Add a scenario to the list."""

    def add(run: Run) -> Run:
        given = sets, sets_if_known, faults, prepare, armed, supervised
        SCENARIOS.append(Scenario(line, name, expected, run, *given))
        return run

    return add


def knows(tree: Path, sets: Sequence[str]) -> bool:
    """Return whether a tree's shipped configuration has the first of these settings."""
    section, _, field = next(iter(sets), "").partition("=")[0].partition(".")
    config = tomllib.loads((tree / "config/t2.toml").read_text())
    return field in config.get(section, {})


@contextlib.contextmanager
def testbed(tree: Path, scenario: Scenario) -> Iterator[Testbed]:
    """Run the testbed of a scenario."""
    port, first, second = (free_port() for _ in range(3))
    sets = [
        f"board.port={port}",
        f"board.listen_ports=[{first}, {second}]",
        *scenario.sets,
        *(scenario.sets_if_known if knows(tree, scenario.sets_if_known) else ()),
    ]
    board = Board(port, (first, second), scenario.faults())
    scenario.prepare(board)
    stack = Stack(tree, sets)
    with contextlib.ExitStack() as ends:
        ends.callback(stack.close)
        board.start()
        ends.callback(board.close)
        stack.start_all(supervised=scenario.supervised)
        bus = ends.enter_context(session(stack.endpoint))
        observer = Observer(bus)
        made = Testbed(board, stack, bus, observer, Operator(bus, observer))
        made.wait(lambda: observer.last(STATE) and observer.last(LINK), UP_S, "stack not up")
        if scenario.armed:
            made.arm(UP_S)
        yield made


def measure(tree: Path, scenario: Scenario) -> Result:
    """Run a scenario against a tree."""
    try:
        with testbed(tree, scenario) as made:
            return scenario.run(made)
    except NotMeasuredError as error:
        return Result(str(error), ok=False)


def seconds(value: float | None) -> str:
    """Return a duration in words."""
    return "never" if value is None else f"{value * 1000:.0f} ms" if value < 1 else f"{value:.2f} s"
