"""Which query is due, which answer is overdue, and which polls are lost."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from common.freshness import NS_PER_S
from common.wire.commands import BumperQuery, DistanceQuery
from common.wire.frame import Frame
from services.bridge.core.polling import Losses, Polling

MS = NS_PER_S // 1000
PERIOD, TIMEOUT, WINDOW = 20 * MS, 100 * MS, 200 * MS
DOUBLE = PERIOD // 8


def polling() -> Polling:
    return Polling([("bumper", BumperQuery(), 50.0), ("mileage", DistanceQuery(), 10.0)], 0.1)


# --- queries -------------------------------------------------------------------------------------


def test_each_at_its_own_rate_when_answers_come() -> None:
    polled = polling()
    counts: dict[Frame, int] = {BumperQuery(): 0, DistanceQuery(): 0}
    for tick in range(1000, 2000, 10):
        for frame in polled.due(tick * MS):
            counts[frame] += 1
        for name in polled.queries:
            polled.answered(name, tick * MS + 3 * MS)
    assert counts == {BumperQuery(): 50, DistanceQuery(): 10}
    assert (polled.round_trip_s(), polled.missed()) == (0.003, {})


def test_an_answer_or_none_leaves_the_rate() -> None:
    polled = polling()
    times = [tick for tick in range(1000, 2000, 10) if BumperQuery() in polled.due(tick * MS)]
    assert times == list(range(1000, 2000, 20))
    assert (polled.lost("bumper", 1980 * MS), polled.missed()) == (11, {"bumper": 49, "mileage": 9})


def test_an_answer_is_no_older_than_its_query_and_an_unsolicited_one_changes_nothing() -> None:
    polled = polling()
    assert polled.answered("bumper", NS_PER_S) == NS_PER_S
    assert polled.round_trip_s() is None
    polled.due(NS_PER_S)
    assert polled.answered("bumper", NS_PER_S + 250 * MS) == NS_PER_S
    assert polled.answered("bumper", NS_PER_S + 310 * MS) == NS_PER_S + 310 * MS
    assert polled.round_trip_s() == 0.25


def test_the_round_trip_is_the_median_of_the_queries() -> None:
    polled = Polling([(name, BumperQuery(), 1.0) for name in "abcde"], 0.1)
    polled.due(NS_PER_S)
    for n, name in enumerate("abcde"):
        polled.answered(name, NS_PER_S + (n + 1) * MS)
    assert polled.round_trip_s() == 0.003


@pytest.mark.parametrize(
    "due",
    [
        # the period is kept while less than a period late; a late poll is not followed at once
        ((1000, 1020), (1023, 1040), (1045, 1060), (1075, 1085), (1105, 1125)),
        # a pause is not caught up in a burst
        ((1000, 1020), (5000, 5020), (5010, 5020), (5020, 5040)),
    ],
)
def test_when_the_next_is_due(due: tuple[tuple[int, int], ...]) -> None:
    polled = polling()
    for tick, next_tick in due:
        polled.due(tick * MS)
        polled.answered("bumper", tick * MS)
        assert polled.queries["bumper"].due_ns == next_tick * MS
        assert isinstance(polled.queries["bumper"].due_ns, int)


def test_a_query_is_sent_at_the_nearest_tick() -> None:
    polled = Polling([("bumper", BumperQuery(), 50.0)], 0.1, tick_s=0.02)
    for tick in (1001, 1020, 1041, 1059, 1080):  # jitter of a millisecond costs no poll
        assert polled.due(tick * MS), tick
        polled.answered("bumper", tick * MS)
    polled.due(2000 * MS)
    polled.answered("bumper", 2001 * MS)
    assert not polled.due(2010 * MS - 1)
    assert polled.due(2010 * MS)


def test_after_a_late_tick_the_answer_has_half_a_period() -> None:
    polled = Polling([("bumper", BumperQuery(), 50.0)], 0.1, tick_s=0.02)
    polled.due(1000 * MS)
    polled.answered("bumper", 1004 * MS)
    assert polled.due(1039 * MS)  # 19 ms late
    assert not polled.due(1040 * MS)
    polled.answered("bumper", 1043 * MS)
    assert polled.due(1060 * MS)
    assert polled.lost("bumper", 1060 * MS) == 0


def test_a_process_that_stalls_loses_nothing() -> None:
    polled = polling()
    for tick in (1000, 1020, 1340, 1350, 1370, 1900):
        if BumperQuery() in polled.due(tick * MS):
            polled.answered("bumper", (tick + 5) * MS)
    assert polled.lost("bumper", 1900 * MS) == 0
    assert polled.missed() == {"mileage": 2}


def test_an_answer_after_a_loss_may_be_that_of_the_poll_before() -> None:
    polled = polling()
    polled.due(NS_PER_S)
    polled.due(NS_PER_S + 20 * MS)
    assert polled.answered("bumper", NS_PER_S + 22 * MS) == NS_PER_S
    for tick in range(1040, 1180, 20):
        polled.due(tick * MS)
    late = "not beyond the timeout"
    assert polled.answered("bumper", NS_PER_S + 162 * MS) == NS_PER_S + 140 * MS, late


def test_a_query_takes_back_a_loss_for_a_late_answer() -> None:
    polled = polling()
    for tick in (1000, 1020, 1040):
        polled.due(tick * MS)
    for tick in (1045, 1055):
        polled.answered("bumper", tick * MS)
    assert polled.lost("bumper", 1055 * MS) == 1


# --- losses ---------------------------------------------------------------------------------------


def counted(*moments: str, until_ms: int) -> tuple[int, int]:
    """Return what is lost within the window, and in total; ``"20 ?"`` polls, ``"21 !"`` answers."""
    losses = Losses(PERIOD, TIMEOUT, WINDOW)
    for moment in moments:
        at, what = moment.split()
        record = losses.on_poll if what == "?" else losses.on_answer
        record(round(float(at) * MS))
    return losses.lost(until_ms * MS), losses.total


@pytest.mark.parametrize(
    ("moments", "until_ms", "lost"),
    [
        ([], 0, (0, 0)),
        (["0 ?"], 15, (0, 0)),
        (["0 ?", "15 !", "20 ?"], 20, (0, 0)),
        (["0 !", "0.1 ?", "0.2 !", "20 ?"], 20, (0, 0)),  # the first answer is no copy
        # known at the next poll, and for the window
        (["0 ?", "20 ?"], 220, (1, 1)),
        (["0 ?", "20 ?"], 221, (0, 1)),
        (["0 ?", "20 ?", "40 ?", "60 ?"], 60, (3, 3)),
        # a late answer takes a loss back, within the timeout
        (["0 ?", "20 ?", "21 !", "120 !"], 120, (0, 0)),
        (["0 ?", "20 ?", "21 !", "120.1 !"], 120, (1, 1)),
        # the oldest that it can be of: too late for the one of 20 ms, not for that of 40
        (["0 ?", "20 ?", "40 ?", "120 ?", "121 !", "125 !"], 125, (2, 2)),
        (["0 ?", "20 ?", "40 ?", "120 ?", "121 !", "125 !"], 221, (1, 2)),
        # a copy is closer than an eighth of a period, also a copy of a copy
        (["0 ?", "20 ?", "21 !", "23.4 !"], 40, (1, 1)),
        (["0 ?", "20 ?", "21 !", "23.5 !"], 40, (0, 0)),
        (["0 ?", "20 ?", "21 !", "23.4 !", "25.8 !", "28.2 !"], 40, (1, 1)),
    ],
)
def test_losses(moments: list[str], until_ms: int, lost: tuple[int, int]) -> None:
    assert counted(*moments, until_ms=until_ms) == lost


def test_an_odd_period_is_halved_three_times() -> None:
    losses = Losses(PERIOD + 1, TIMEOUT, WINDOW)
    for number in range(3):
        losses.on_poll(number * PERIOD)
    for behind_ns in (0, DOUBLE):
        losses.on_answer(2 * PERIOD + MS + behind_ns)
    assert losses.lost(3 * PERIOD) == 1


def test_what_left_the_window_is_forgotten_without_being_asked_for() -> None:
    losses = Losses(PERIOD, TIMEOUT, WINDOW)
    for number in range(100):
        losses.on_poll(number * PERIOD)
    assert len(losses._lost_ns) == 11


class Line(RuleBasedStateMachine):
    """Answers within their slot, doubled or dropped, and pauses: exactly the dropped count."""

    def __init__(self) -> None:
        super().__init__()
        self.losses = Losses(PERIOD, TIMEOUT, WINDOW)
        self.now_ns = NS_PER_S
        self.ended_ns: list[int] = []  # the slots without an answer
        self.open = False  # whether the current slot has none yet

    @rule(wait_ms=st.integers(10, 400), copies=st.integers(0, 2), trip_ms=st.integers(1, 7))
    def poll(self, wait_ms: int, copies: int, trip_ms: int) -> None:
        self.now_ns += wait_ms * MS
        self.losses.on_poll(self.now_ns)
        self.ended_ns += [self.now_ns] if self.open else []
        for number in range(copies):
            self.losses.on_answer(self.now_ns + trip_ms * MS + number * (DOUBLE - 1))
        self.open = not copies

    @invariant()
    def exactly_the_dropped_ones_count(self) -> None:
        recent = [ns for ns in self.ended_ns if self.now_ns - ns <= WINDOW]
        assert self.losses.lost(self.now_ns) == len(recent)
        assert self.losses.total == len(self.ended_ns)


TestLine = Line.TestCase


def replay(polls: list[int], answers: list[int]) -> list[tuple[int, int]]:
    """Return the time of each poll and how many were lost by then, the poll's slot included."""
    losses, seen = Losses(PERIOD, TIMEOUT, WINDOW), []
    for at, is_poll in sorted([*((at, 1) for at in polls), *((at, 0) for at in answers)]):
        if is_poll:
            losses.on_poll(at)
            seen.append((at, losses.lost(at)))
        else:
            losses.on_answer(at)
    return seen


@given(st.integers(0, 99), st.integers(20, 60))
def test_a_constant_delay_is_no_loss(delay_ms: int, number: int) -> None:
    polls = [NS_PER_S + n * PERIOD for n in range(number)]
    for at, count in replay(polls, [at + delay_ms * MS + 1 for at in polls]):
        assert count <= 5
        assert count == 0 or at < NS_PER_S + WINDOW + TIMEOUT + PERIOD


@given(st.lists(st.integers(1, 30), min_size=20, max_size=80))
def test_a_delay_that_varies_by_a_period_and_a_half_is_no_three_losses(
    delays_ms: list[int],
) -> None:
    polls = [NS_PER_S + n * PERIOD for n in range(len(delays_ms))]
    answers: list[int] = []
    for at, ms in zip(polls, delays_ms, strict=True):
        after = answers[-1] + DOUBLE if answers else 0  # a cable keeps their order
        answers.append(max(at + ms * MS, after))
    assert max(count for _, count in replay(polls, answers)) < 3
