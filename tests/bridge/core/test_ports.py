"""Which of our two ports each kind of frame is taken from."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.freshness import NS_PER_S
from common.wire.reports import BumperReport, VelocityReport
from services.bridge.core.ports import Ports

MS = NS_PER_S // 1000
FAILOVER = 100 * MS


def ports(count: int = 2) -> Ports:
    return Ports(count, FAILOVER, NS_PER_S)


@pytest.mark.parametrize(
    ("silent_ns", "port"),
    [(-1, 1), (0, 1), (NS_PER_S // 2 - 1, 1), (NS_PER_S // 2, 2), (NS_PER_S, 0),
     (3 * NS_PER_S // 2, 1)],
)  # fmt: skip
def test_a_query_leaves_from_the_port_of_the_answers_and_without_any_from_all_in_turn(
    silent_ns: int, port: int
) -> None:
    made = ports(3)
    made.takes(VelocityReport, 0, NS_PER_S)
    made.takes(BumperReport, 1, NS_PER_S)
    assert made.to_ask(NS_PER_S + silent_ns) == port


def test_before_any_answer_the_port_of_the_commands_comes_first() -> None:
    made = ports()
    made.takes(VelocityReport, 1, NS_PER_S)
    turns = [made.to_ask(NS_PER_S + at * 250 * MS) for at in range(6)]
    assert turns == [1, 1, 0, 0, 1, 1]
    assert ports(count=1).to_ask(9 * NS_PER_S) == 0


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
