"""Which of our two ports each kind of frame is taken from."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.freshness import NS_PER_S
from common.wire.frame import Frame
from common.wire.reports import BumperReport, DriverReport, LedReport, VelocityReport
from services.bridge.core.ports import Ports

MS = NS_PER_S // 1000
FAILOVER = 100 * MS
RATES: dict[type[Frame], float] = {BumperReport: 50.0, DriverReport: 2.0}


def ports(count: int = 2) -> Ports:
    return Ports(count, FAILOVER, RATES, NS_PER_S)


@pytest.mark.parametrize("port", [0, 1])
def test_the_first_frame_of_a_kind_is_taken_from_either_port(port: int) -> None:
    made = ports()
    assert made.of(BumperReport) is None
    assert made.takes(BumperReport, port, NS_PER_S)
    assert (made.of(BumperReport), made.by_name()) == (port, {"BumperReport": port})
    assert not made.takes(BumperReport, 1 - port, NS_PER_S)
    assert made.takes(BumperReport, port, NS_PER_S)


def test_each_kind_has_a_port_of_its_own() -> None:
    made = ports()
    for tick in range(100):
        assert made.takes(VelocityReport, 0, NS_PER_S + tick * 20 * MS)
        assert made.takes(BumperReport, 1, NS_PER_S + tick * 20 * MS)
    assert made.by_name() == {"VelocityReport": 0, "BumperReport": 1}
    assert made.main == 0


@pytest.mark.parametrize(
    ("kind", "timeout"),
    [(VelocityReport, FAILOVER), (BumperReport, FAILOVER), (DriverReport, 1250 * MS)],
)
def test_the_other_port_takes_over_when_its_kind_is_silent(kind: type[Frame], timeout: int) -> None:
    made = ports()
    made.takes(kind, 0, NS_PER_S)
    assert not made.takes(kind, 1, NS_PER_S + timeout)
    assert made.takes(kind, 1, NS_PER_S + timeout + 1)
    assert made.of(kind) == 1
    assert not made.takes(kind, 0, NS_PER_S + timeout + 2)


def test_an_urgent_frame_is_taken_from_either_port() -> None:
    made = ports()
    made.takes(BumperReport, 0, NS_PER_S)
    assert made.takes(BumperReport, 1, NS_PER_S, urgent=True)
    assert made.of(BumperReport) == 1


def test_commands_leave_from_where_the_velocity_comes_to() -> None:
    made = ports()
    mains = [made.main]
    for kind, port, at_s in (
        (BumperReport, 1, 1), (VelocityReport, 0, 1), (BumperReport, 1, 1), (VelocityReport, 1, 2),
    ):  # fmt: skip
        made.takes(kind, port, at_s * NS_PER_S)
        mains.append(made.main)
    assert mains == [0, 1, 0, 0, 1], "without a velocity from the port of any frame"


@pytest.mark.parametrize(
    ("kind", "silent_ns", "port"),
    [
        (BumperReport, -1, 1),
        (BumperReport, 0, 1),
        (BumperReport, NS_PER_S // 2 - 1, 1),
        (BumperReport, NS_PER_S // 2, 2),
        (BumperReport, NS_PER_S, 0),
        (BumperReport, 3 * NS_PER_S // 2, 1),
        (DriverReport, 1250 * MS - 1, 0),
        (DriverReport, 1250 * MS, 1),
        (LedReport, 9 * NS_PER_S, 1),
    ],
)
def test_a_query_leaves_from_the_port_of_its_answers_and_without_any_from_all_in_turn(
    kind: type[Frame], silent_ns: int, port: int
) -> None:
    made = ports(3)
    for received, at in ((VelocityReport, 0), (BumperReport, 1), (DriverReport, 0)):
        made.takes(received, at, NS_PER_S)
    assert made.to_ask(kind, NS_PER_S + silent_ns) == port


def test_what_was_never_answered_is_asked_from_the_main_port_first() -> None:
    made = ports()
    made.takes(VelocityReport, 1, NS_PER_S)
    turns = [made.to_ask(BumperReport, NS_PER_S + at * 250 * MS) for at in range(6)]
    assert turns == [1, 1, 0, 0, 1, 1]
    assert made.to_ask(LedReport, 9 * NS_PER_S) == 1
    assert ports(count=1).to_ask(BumperReport, 9 * NS_PER_S) == 0


@pytest.mark.parametrize(
    ("age", "received"), [(0, True), (NS_PER_S // 2, True), (NS_PER_S // 2 + 1, False)]
)
def test_a_frame_counts_as_received_for_half_a_second(age: int, received: bool) -> None:
    made = ports()
    assert not made.is_received(BumperReport, NS_PER_S)
    made.takes(BumperReport, 0, NS_PER_S)
    assert made.is_received(BumperReport, NS_PER_S + age) is received


@given(st.lists(st.tuples(st.integers(1, 400), st.integers(-20, 20), st.booleans(), st.booleans())))
def test_no_frame_is_taken_twice_none_after_a_newer_one_and_no_port_is_waited_for_too_long(
    frames: list[tuple[int, int, bool, bool]],
) -> None:
    """Each frame goes to both ports, a little apart, and may be lost on one of them."""
    events = []
    now = 2 * NS_PER_S
    for number, (wait_ms, skew_ms, on_first, on_second) in enumerate(frames):
        now += max(wait_ms, 41) * MS  # copies stay together
        for port, arrives in ((0, on_first), (1, on_second)):
            if arrives:
                events.append((now + (skew_ms * MS if port else 0), port, number))
    made, taken = ports(), []
    missed_ns: int | None = None
    for at_ns, port, number in sorted(events):
        if made.takes(BumperReport, port, at_ns):
            taken.append(number)
            missed_ns = None
        elif number not in taken:
            missed_ns = missed_ns or at_ns
            assert at_ns - missed_ns <= FAILOVER
    assert taken == sorted(set(taken))
