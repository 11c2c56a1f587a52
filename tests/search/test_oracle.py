"""The oracle observes drives, and objects to a stack with a protection removed."""

from collections.abc import Iterable

import pytest

from common.freshness import NS_PER_S
from common.wire.reports import BumperReport
from tests.search.mutations import MUTATIONS, driver_blinks
from tests.search.scripted_stack import ScriptedStack, driving
from verification.search.bridge_book import BridgeBook, PressBook
from verification.search.ros import PATTERNS


def check_it_drives(stack: ScriptedStack) -> None:
    runs = stack.oracle.runs
    stack.request(0.5, 500)
    assert stack.oracle.runs > runs
    assert stack.oracle.violations == []


@pytest.mark.parametrize("hung_ms", [0, 60])
def test_a_fault_that_is_over_at_once_latches_however_late_it_is_read(hung_ms: int) -> None:
    stack = driving()
    stack.stall("safety", hung_ms)
    driver_blinks(stack)
    stack.run(300)
    runs = stack.oracle.runs
    stack.run(1000)
    assert {trip.name for trip in stack.oracle.trips} == {"driver"}
    assert (stack.oracle.runs, stack.vehicle.simulation.twist.linear) == (runs, 0.0)
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
    """And to nothing in the same scenario with the protection."""
    (owner, attribute, broken), scenario, objection = MUTATIONS[name]
    change = monkeypatch.setitem if isinstance(owner, dict) else monkeypatch.setattr
    for is_missing in (False, True):
        if is_missing:
            change(owner, attribute, broken)
        stack = driving()
        assert stack.oracle.violations == []
        for step in scenario:
            step(stack)
        stack.run(2000)
        found = stack.oracle.violations
        assert any(objection in one for one in found) if is_missing else found == [], found[:5]


def test_a_source_that_was_neutral_long_ago_may_slow_down_another_one() -> None:
    stack = driving()
    stack.request(0.0, 700)
    stack.request(None, 2000)
    stack.drive(0.5, 1500, source="nav")
    stack.request(0.0, 700)
    assert stack.oracle.violations == []


@pytest.mark.parametrize("pattern", PATTERNS)
def test_ros_nodes_drive_and_after_a_reset_not_before_a_pause(pattern: str) -> None:
    stack = driving()
    stack.request(None, 1500)
    runs = stack.oracle.runs
    stack.ros(pattern, 0.5, 1500)
    assert stack.oracle.runs > runs + 10
    stack.stop(100)
    stack.ros("topic_pub", 0.5, 1500)
    assert stack.reset().done
    runs = stack.oracle.runs
    stack.run(3000)
    assert stack.oracle.runs == runs
    stack.ros(pattern, 0.5, 4500)
    assert stack.oracle.runs > runs
    assert stack.oracle.violations == []


def test_a_ros_node_whose_link_comes_up_does_not_drive_before_a_pause() -> None:
    stack = driving()
    stack.request(None, 1500)
    runs = stack.oracle.runs
    stack.ros("topic_pub", 0.5, 6000, unheard=45)
    assert stack.oracle.runs == runs
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


def hits(samples: Iterable[tuple[int, bool]]) -> list[int]:
    """Return which samples of the bumper, each of a port, begin a hit."""
    book = BridgeBook(1)
    return [
        number
        for number, (port, pressed) in enumerate(samples)
        if book.on_report(BumperReport(pressed), port, number * NS_PER_S // 50)
    ]


@pytest.mark.parametrize(
    ("closed_ms", "report_ms", "stop_ms", "missed"),
    [
        (50, None, None, False),  # too short
        (60, None, None, True),
        (300, None, None, True),
        (60, 100, None, False),
        (60, None, 170, False),  # it is stopped in time
        (60, None, 200, True),
    ],
)
def test_a_press_is_reported_or_the_vehicle_stops(
    closed_ms: int, report_ms: int | None, stop_ms: int | None, missed: bool
) -> None:
    book = PressBook()
    book.on_frame(moves=True)
    found = []
    for ms in range(0, 500, 10):
        if ms == stop_ms:
            book.on_frame(moves=False)
        book.noticed |= ms == report_ms
        found.append(book.look(ms < closed_ms, ms * NS_PER_S // 1000))
    assert sum(found) == missed


def test_a_press_while_the_vehicle_is_not_driven_is_not_missed() -> None:
    book = PressBook()
    assert not any(book.look(ms < 60, ms * NS_PER_S // 1000) for ms in range(0, 500, 10))
