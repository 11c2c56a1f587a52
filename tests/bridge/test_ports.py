"""Which of our two ports each kind of frame is taken from."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.freshness import NS_PER_S
from common.wire.frame import Frame
from common.wire.reports import BumperReport, DriverReport, LedReport, VelocityReport
from services.bridge.ports import Ports

MS = NS_PER_S // 1000
FAILOVER = 100 * MS
RATES: dict[type[Frame], float] = {BumperReport: 50.0, DriverReport: 2.0}


def ports(count: int = 2) -> Ports:
    return Ports(count, FAILOVER, RATES, NS_PER_S)


def come(ports: Ports, kind: type[Frame], port: int, now_ns: int) -> bool:
    """Pass a frame in; return whether it was taken."""
    taken = ports.takes(kind, port, now_ns)
    if taken:
        ports.take(kind, port, now_ns)
    return taken


@pytest.mark.parametrize("port", [0, 1])
def test_the_first_frame_of_a_kind_is_taken_from_either_port(port: int) -> None:
    made = ports()
    assert made.takes(BumperReport, port, NS_PER_S)
    assert not made.take(BumperReport, port, NS_PER_S)
    assert made.by_name() == {"BumperReport": port}
    assert not made.takes(BumperReport, 1 - port, NS_PER_S)
    assert made.takes(BumperReport, port, NS_PER_S)


def test_each_kind_has_a_port_of_its_own() -> None:
    made = ports()
    for tick in range(100):
        assert come(made, VelocityReport, 0, NS_PER_S + tick * 20 * MS)
        assert come(made, BumperReport, 1, NS_PER_S + tick * 20 * MS)
    assert made.by_name() == {"VelocityReport": 0, "BumperReport": 1}
    assert made.main == 0


@pytest.mark.parametrize(
    ("kind", "patience"),
    [(VelocityReport, FAILOVER), (BumperReport, FAILOVER), (DriverReport, 1250 * MS)],
)
def test_the_other_port_takes_over_when_its_kind_is_silent(
    kind: type[Frame], patience: int
) -> None:
    made = ports()
    come(made, kind, 0, NS_PER_S)
    made.takes(LedReport, 0, NS_PER_S + patience)  # the port is active
    assert not made.takes(kind, 1, NS_PER_S + patience)
    made.takes(LedReport, 0, NS_PER_S + patience + 1)
    assert made.takes(kind, 1, NS_PER_S + patience + 1)
    assert made.take(kind, 1, NS_PER_S + patience + 1)
    assert made.by_name()[kind.__name__] == 1
    assert not made.takes(kind, 0, NS_PER_S + patience + 2)


def test_a_port_that_is_dead_altogether_is_left_after_the_failover_time() -> None:
    made = ports()
    come(made, DriverReport, 0, NS_PER_S)
    assert not made.takes(DriverReport, 1, NS_PER_S + FAILOVER)
    assert made.takes(DriverReport, 1, NS_PER_S + FAILOVER + 1)


def test_a_copy_that_is_dropped_shows_that_its_port_lives() -> None:
    made = ports()
    come(made, DriverReport, 1, NS_PER_S)
    for tick in range(12):
        come(made, VelocityReport, 0, NS_PER_S + tick * 100 * MS)
        come(made, VelocityReport, 1, NS_PER_S + tick * 100 * MS)  # a copy
    assert not made.takes(DriverReport, 0, NS_PER_S + 1200 * MS)


def test_commands_leave_from_where_the_velocity_comes_to() -> None:
    made = ports()
    assert made.main == 0
    come(made, BumperReport, 1, NS_PER_S)
    assert made.main == 1, "the only port with frames"
    come(made, VelocityReport, 0, NS_PER_S)
    assert made.main == 0
    come(made, BumperReport, 1, NS_PER_S)
    assert made.main == 0
    come(made, VelocityReport, 1, 2 * NS_PER_S)
    assert made.main == 1


@pytest.mark.parametrize(
    ("silent_ns", "port"),
    [(0, 1), (NS_PER_S // 2 - 1, 1), (NS_PER_S // 2, 0), (NS_PER_S - 1, 0), (NS_PER_S, 1), (-1, 1)],
)
def test_a_query_leaves_from_where_its_answers_come_to_and_else_in_turn(
    silent_ns: int, port: int
) -> None:
    made = ports()
    come(made, VelocityReport, 0, NS_PER_S)
    come(made, BumperReport, 1, NS_PER_S)
    assert made.to_ask(BumperReport, NS_PER_S + silent_ns) == port


def test_a_slow_query_is_not_unanswered_between_two_answers() -> None:
    made = ports()
    come(made, VelocityReport, 0, NS_PER_S)
    for second in range(2, 6):
        come(made, DriverReport, 0, second * NS_PER_S)
        assert made.to_ask(DriverReport, second * NS_PER_S + 1250 * MS - 1) == 0
    assert made.to_ask(DriverReport, 5 * NS_PER_S + 1250 * MS) == 1


def test_what_is_asked_for_now_and_then_is_asked_where_polls_are_answered() -> None:
    made = ports()
    come(made, VelocityReport, 0, NS_PER_S)
    assert made.to_ask(LedReport, 9 * NS_PER_S) == 0
    come(made, BumperReport, 1, NS_PER_S)
    assert made.to_ask(LedReport, 9 * NS_PER_S) == 1


def test_what_was_never_answered_is_asked_for_from_the_main_port_first() -> None:
    made = ports()
    come(made, VelocityReport, 1, NS_PER_S)
    turns = [made.to_ask(BumperReport, NS_PER_S + at * 250 * MS) for at in range(6)]
    assert turns == [1, 1, 0, 0, 1, 1]
    assert ports(count=1).to_ask(BumperReport, 9 * NS_PER_S) == 0


@pytest.mark.parametrize(
    ("age", "received"), [(0, True), (NS_PER_S // 2, True), (NS_PER_S // 2 + 1, False)]
)
def test_a_frame_counts_as_received_for_half_a_second(age: int, received: bool) -> None:
    made = ports()
    assert not made.is_received(BumperReport, NS_PER_S)
    come(made, BumperReport, 0, NS_PER_S)
    assert made.is_received(BumperReport, NS_PER_S + age) is received


@given(st.lists(st.tuples(st.integers(1, 400), st.integers(-20, 20), st.booleans(), st.booleans())))
def test_no_frame_is_taken_twice_and_none_is_lost_for_longer_than_the_patience(
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
        if come(made, BumperReport, port, at_ns):
            taken.append(number)
            missed_ns = None
        elif number not in taken:
            missed_ns = missed_ns or at_ns
            assert at_ns - missed_ns <= FAILOVER
    assert len(set(taken)) == len(taken)


def test_unanswered_queries_leave_from_the_ports_in_turn() -> None:
    made = ports(3)
    come(made, BumperReport, 1, NS_PER_S)
    turns = [made.to_ask(BumperReport, NS_PER_S + turn * NS_PER_S // 2) for turn in range(4)]
    assert turns == [1, 2, 0, 1]
