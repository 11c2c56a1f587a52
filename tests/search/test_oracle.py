"""The oracle observes drives, and objects to a stack with a protection removed."""

from collections.abc import Iterable

import pytest

from common.freshness import NS_PER_S
from common.wire.reports import BumperReport
from tests.search.mutations import MUTATIONS, driver_blinks
from tests.search.scripted_stack import ScriptedStack, driving
from verification.search.bridge_book import BridgeBook


def linear(stack: ScriptedStack) -> float:
    return stack.vehicle.simulation.twist.linear


def trips(stack: ScriptedStack) -> set[str]:
    return {trip.name for trip in stack.oracle.trips}


def check_it_drives(stack: ScriptedStack) -> None:
    runs = stack.oracle.runs
    stack.request(0.5, 500)
    assert stack.oracle.runs > runs
    assert stack.oracle.violations == []


def test_a_drive_is_observed_without_violations() -> None:
    stack = driving()
    assert stack.oracle.runs > 50
    assert stack.oracle.violations == []


def test_a_hit_stops_and_only_reset_and_neutral_let_it_drive_again() -> None:
    stack = driving()
    stack.press(True, 300)
    runs = stack.oracle.runs
    stack.press(False, 3000)
    assert (stack.oracle.runs, linear(stack)) == (runs, 0.0)
    stack.request(0.0, 600)
    assert stack.reset().done
    stack.run(200)
    check_it_drives(stack)


def test_a_pressed_bumper_is_released_after_a_reset_and_not_before() -> None:
    stack = driving()
    stack.press(True)
    stack.stop()
    stack.request(None, 2000)
    runs = stack.oracle.runs
    stack.creep()
    assert stack.oracle.runs == runs
    assert stack.reset().done
    start_m = stack.vehicle.simulation.pose.x
    stack.creep()
    assert stack.oracle.runs > runs
    assert -0.08 < stack.vehicle.simulation.pose.x - start_m < -0.02
    assert trips(stack) == {"contact"}
    assert stack.oracle.violations == []


def test_a_motion_without_a_command_wants_a_reset_of_the_next_safety() -> None:
    stack = driving()
    stack.request(0.0, 1500)
    stack.kill("safety", 3000)
    stack.run(1000)
    stack.measure(0.3, 600)
    stack.measure(None, 3000)
    assert stack.seen is not None
    assert "predecessor" in [cause.name for cause in stack.seen.causes]
    runs = stack.oracle.runs
    stack.request(0.5, 1000)
    assert stack.oracle.runs == runs
    stack.request(0.0, 700)
    assert stack.reset().done
    stack.run(700)
    check_it_drives(stack)


@pytest.mark.parametrize("hung_ms", [0, 60])
def test_a_fault_that_is_over_at_once_latches_however_late_it_is_read(hung_ms: int) -> None:
    stack = driving()
    stack.stall("safety", hung_ms)
    driver_blinks(stack)
    stack.run(300)
    runs = stack.oracle.runs
    stack.run(1000)
    assert trips(stack) == {"driver"}
    assert (stack.oracle.runs, linear(stack)) == (runs, 0.0)
    assert stack.oracle.violations == []


@pytest.mark.parametrize("name", ["safety", "bridge", "board", "router"])
def test_a_restarted_part_drives_after_a_neutral_request_and_not_before(name: str) -> None:
    stack = driving()
    if name == "board":
        stack.power_cycle(500)
    elif name == "router":
        stack.outage(500)
    else:
        stack.kill(name, 300)
    stack.run(500)
    runs = stack.oracle.runs
    stack.run(1500)
    assert stack.oracle.runs == runs
    stack.request(0.0, 700)
    assert bool(stack.reset().done) == (name == "router")
    stack.run(700)
    check_it_drives(stack)


@pytest.mark.parametrize("name", MUTATIONS)
def test_the_oracle_objects_to_a_missing_protection(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    (owner, attribute, broken), scenario, objection = MUTATIONS[name]
    change = monkeypatch.setitem if isinstance(owner, dict) else monkeypatch.setattr
    change(owner, attribute, broken)
    stack = driving()
    assert stack.oracle.violations == []
    for step in scenario:
        step(stack)
    stack.run(2000)
    assert any(objection in one for one in stack.oracle.violations), stack.oracle.violations[:5]


@pytest.mark.parametrize("name", MUTATIONS)
def test_the_same_scenario_is_harmless_with_the_protection(name: str) -> None:
    stack = driving()
    for step in MUTATIONS[name][1]:
        step(stack)
    stack.run(2000)
    assert stack.oracle.violations == []


PORT_0, BOTH = [(0, False)] * 3, [(0, False), (1, False)] * 3


@pytest.mark.parametrize(
    ("samples", "found"),
    [
        ([(0, True), (0, True)], [0]),
        ([(0, True), *PORT_0, (0, True)], [0, 4]),
        # A copy on the other port is no further sample.
        ([(0, True), (1, True), *BOTH[:4], (0, True)], [0]),
        ([(0, True), (1, True), *BOTH, (0, True)], [0, 8]),
    ],
)
def test_three_clear_samples_of_a_port_end_a_hit(
    samples: Iterable[tuple[int, bool]], found: list[int]
) -> None:
    assert hits(samples) == found


def test_a_port_that_has_fallen_silent_does_not_hide_a_hit() -> None:
    of_port_1 = [False] * 20 + [True] + [False] * 3 + [True]
    samples = [(0, True), (1, True), *((1, pressed) for pressed in of_port_1)]
    assert hits(samples) == [0, 22, 26]


def hits(samples: Iterable[tuple[int, bool]]) -> list[int]:
    """Return which samples of the bumper, each of a port, begin a hit."""
    book = BridgeBook(1)
    return [
        number
        for number, (port, pressed) in enumerate(samples)
        if book.on_report(BumperReport(pressed), port, number * NS_PER_S // 50)
    ]
