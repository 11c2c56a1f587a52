"""The core of safety over recordings of the simulated stack: every motion comes out again."""

from collections.abc import Callable
from itertools import pairwise

import msgspec
import pytest

from cli.recordings.decision_replay import Decided, Replay, new_stops
from cli.recordings.safety_inputs import Recorded, Run, runs
from common.settings import Vehicle
from services.safety.config import SafetyConfig
from sim import requests as q
from sim.config import load_plan
from t2 import messages as m
from tests.cli.recordings.decision_fixture import Tap, drive, reset
from verification.search.bus import MS
from verification.search.condition_books import NEEDED
from verification.search.stack import Stack

pytestmark = pytest.mark.simulated

STEP_MS = 5


class Drive:
    """A recorded drive of the simulated stack."""

    def __init__(self, world: str = "office") -> None:
        self.stack = Stack(plan=load_plan(world, Vehicle()), step_ns=STEP_MS * MS)
        self.tap = Tap(self.stack)
        self.stack.run(1500)
        drive(self.stack)
        self.stack.run(500)

    @property
    def settings(self) -> SafetyConfig:
        config = self.stack.processes["safety"].config
        assert isinstance(config, SafetyConfig)
        return config

    def runs(self) -> list[Run]:
        return runs(self.tap.recorded)


def replayed(settings: SafetyConfig, run: Run) -> list[Decided]:
    return list(Replay(settings, run).decisions())


def differing(decisions: list[Decided]) -> list[Decided]:
    return [one for one in decisions if one.is_compared and one.differences]


def stops(decisions: list[Decided]) -> list[str]:
    """Return the worst cause of each stop."""
    pairs = pairwise(decisions)
    return [names[0] for before, one in pairs if (names := new_stops(before, one))]


def towards_a_wall(it: Drive) -> None:
    drive(it.stack, 0.6)
    it.stack.run(6000)


def at_a_sonar(it: Drive) -> None:
    drive(it.stack, 0.3)
    it.stack.run(1500)
    it.stack.vehicle.inject(q.Sonar(name="front", range=0.15))
    it.stack.run(1000)
    it.stack.vehicle.inject(q.Sonar(name="front"))
    it.stack.run(1000)


def at_a_bumper_and_on(it: Drive) -> None:
    drive(it.stack, -0.3, 0.3)
    it.stack.run(1000)
    it.stack.tap(300)
    it.stack.run(1500)
    reset(it.stack)
    drive(it.stack, 0.0, 0.5)
    it.stack.run(1000)


def at_an_emergency_stop_and_on(it: Drive) -> None:
    drive(it.stack, 0.0, 0.5)
    it.stack.run(1015)
    it.stack.estop()
    it.stack.run(1000)
    reset(it.stack)
    drive(it.stack, 0.0, -0.5)
    it.stack.run(1000)


def at_a_source_that_ends(it: Drive) -> None:
    drive(it.stack, 0.2)
    it.stack.run(1000)
    it.stack.sources["teleop"].message = None
    it.stack.run(1000)


def at_a_limit(it: Drive) -> None:
    drive(it.stack, 0.4)
    it.stack.run(1000)
    it.stack.sources[NEEDED].message = m.Limit(echo=0, linear=0.0, reason="person")
    it.stack.run(1000)
    it.stack.sources[NEEDED].message = None
    it.stack.run(1500)


def at_a_driver_fault(it: Drive) -> None:
    drive(it.stack, 0.3)
    it.stack.run(1000)
    it.stack.vehicle.inject(q.Driver(side="left", bits=1))
    it.stack.run(1500)
    it.stack.vehicle.inject(q.Driver(side="left", bits=0))
    it.stack.run(3000)
    reset(it.stack)


def at_a_mute_board(it: Drive) -> None:
    drive(it.stack, 0.3)
    it.stack.run(1000)
    it.stack.vehicle.inject(q.Mute(reports=("ultrasonic",)))
    it.stack.run(1000)
    it.stack.vehicle.inject(q.Mute(reports=()))
    it.stack.run(1500)


@pytest.mark.parametrize(
    ("happens", "causes"),
    [
        (towards_a_wall, []),
        (at_a_sonar, ["blocked"]),
        (at_a_bumper_and_on, ["contact"]),
        (at_an_emergency_stop_and_on, ["estop"]),
        (at_a_source_that_ends, ["no_request"]),
        (at_a_limit, ["limit_stop"]),
        (at_a_driver_fault, ["driver_left"]),
        (at_a_mute_board, ["blocked"]),
    ],
)
def test_every_motion_comes_out_again(happens: Callable[[Drive], None], causes: list[str]) -> None:
    it = Drive()
    happens(it)
    (run,) = it.runs()
    decisions = replayed(it.settings, run)
    assert differing(decisions) == []
    assert sum(not one.is_compared for one in decisions) < 80  # 1.6 s, of which 1.5 are the start
    assert sum(one.is_reordered for one in decisions) <= 2
    assert [name for name in stops(decisions) if name != "starting"] == causes


def test_a_recording_that_begins_after_the_first_sample_of_a_slow_input() -> None:
    stack = Stack(plan=load_plan("office", Vehicle()), step_ns=STEP_MS * MS)
    tap = Tap(stack)
    drive(stack)
    stack.vehicle.inject(q.Mute(reports=("bumper",)))  # safety is starting for 0.7 s
    stack.run(200)
    stack.vehicle.inject(q.Mute(reports=()))
    stack.run(3000)
    config = stack.processes["safety"].config
    assert isinstance(config, SafetyConfig)
    early_ns = tap.recorded[0].log_ns + 500 * MS  # the next switches come after 1 s
    lost = [it for it in tap.recorded if isinstance(it.message, m.Switches)]
    lost = [it for it in lost if it.log_ns < early_ns]
    (run,) = runs([one for one in tap.recorded if one not in lost])
    decisions = replayed(config, run)
    assert lost
    assert differing(decisions) == []
    assert sum(one.is_compared for one in decisions) > 50


def test_a_first_sample_that_the_recorder_has_and_safety_does_not_have() -> None:
    stack = Stack(plan=load_plan("office", Vehicle()), step_ns=STEP_MS * MS)
    tap = Tap(stack)
    drive(stack)
    stack.vehicle.inject(q.Mute(reports=("bumper", "driver")))
    stack.run(1000)
    stack.vehicle.inject(q.Mute(reports=("driver",)))
    stack.run(700)
    stack.vehicle.inject(q.Mute(reports=()))
    stack.run(3000)
    config = stack.processes["safety"].config
    assert isinstance(config, SafetyConfig)
    recorded = tap.recorded
    at_ns = recorded[0].log_ns + 100 * MS  # safety receives the first ones after 1.7 s
    early = []
    for path in ("tel/bridge/driver/left", "tel/bridge/driver/right"):
        first = next(it for it in recorded if it.path == path)
        assert isinstance(first.message, m.Driver)
        past_ns = first.log_ns - at_ns
        assert past_ns > 1000 * MS
        mono_ns = first.message.mono_ns - past_ns
        message = msgspec.structs.replace(first.message, mono_ns=mono_ns)
        early.append(Recorded(path, message, at_ns))
    (run,) = runs(sorted([*recorded, *early], key=lambda one: one.log_ns))
    decisions = replayed(config, run)
    assert differing(decisions) == []
    assert sum(one.is_compared for one in decisions) > 50
