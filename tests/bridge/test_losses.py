"""Lost polls are counted although answers carry no number."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.freshness import NS_PER_S
from services.bridge.losses import Losses

MS = NS_PER_S // 1000
PERIOD, TIMEOUT, WINDOW = 20 * MS, 100 * MS, 200 * MS
DOUBLE = PERIOD // 8


def losses() -> Losses:
    return Losses(PERIOD, TIMEOUT, WINDOW)


def replay(polls: list[int], answers: list[int]) -> list[tuple[int, int]]:
    """Return the time of each poll and how many were lost by then, the poll's slot included."""
    made, seen = losses(), []
    events = sorted([*((at, 1) for at in polls), *((at, 0) for at in answers)])
    for at, is_poll in events:
        if is_poll:
            made.on_poll(at)
            seen.append((at, made.lost(at)))
        else:
            made.on_answer(at)
    return seen


def test_nothing_is_lost_before_anything_was_asked() -> None:
    made = losses()
    assert (made.lost(NS_PER_S), made.total) == (0, 0)
    made.on_poll(NS_PER_S)
    assert made.lost(NS_PER_S + 15 * MS) == 0
    made.on_answer(NS_PER_S + 15 * MS)
    made.on_poll(NS_PER_S + PERIOD)
    assert (made.lost(NS_PER_S + PERIOD), made.total) == (0, 0)


def test_a_lost_poll_is_known_at_the_next_one_and_for_the_window() -> None:
    made = losses()
    made.on_poll(NS_PER_S)
    made.on_poll(NS_PER_S + PERIOD)
    made.on_answer(NS_PER_S + PERIOD + MS)
    assert made.lost(NS_PER_S + PERIOD + WINDOW) == 1
    assert made.lost(NS_PER_S + PERIOD + WINDOW + 1) == 0
    assert made.total == 1


def test_what_left_the_window_is_forgotten_without_being_asked_for() -> None:
    made = losses()
    for number in range(100):
        made.on_poll(NS_PER_S + number * PERIOD)
    assert len(made._lost_ns) == 11


@pytest.mark.parametrize(("late", "left"), [(TIMEOUT, 0), (TIMEOUT + 1, 1)])
def test_a_late_answer_takes_its_loss_back(late: int, left: int) -> None:
    made = losses()
    made.on_poll(NS_PER_S)
    made.on_poll(NS_PER_S + PERIOD)  # the first one is lost
    made.on_answer(NS_PER_S + PERIOD + MS)
    made.on_answer(NS_PER_S + PERIOD + late)
    assert (made.lost(NS_PER_S + PERIOD + late), made.total) == (left, left)


def test_a_late_answer_takes_the_oldest_loss_back_that_it_can_be_of() -> None:
    made = losses()
    for at in (0, 20, 40, 120):
        made.on_poll(NS_PER_S + at * MS)  # lost at 20, 40 and 120
    made.on_answer(NS_PER_S + 121 * MS)
    made.on_answer(NS_PER_S + 125 * MS)  # too late for 20, not for 40
    assert list(made._lost_ns) == [NS_PER_S + 20 * MS, NS_PER_S + 120 * MS]


@pytest.mark.parametrize(("behind", "left"), [(DOUBLE - 1, 1), (DOUBLE, 0)])
def test_a_copy_takes_no_loss_back(behind: int, left: int) -> None:
    made = losses()
    made.on_poll(NS_PER_S)
    made.on_poll(NS_PER_S + PERIOD)
    made.on_answer(NS_PER_S + PERIOD + MS)
    made.on_answer(NS_PER_S + PERIOD + MS + behind)
    assert made.lost(NS_PER_S + 2 * PERIOD) == left


def test_a_copy_of_a_copy_is_one() -> None:
    made = losses()
    made.on_poll(NS_PER_S)
    made.on_poll(NS_PER_S + PERIOD)
    for step in range(4):
        made.on_answer(NS_PER_S + PERIOD + step * (DOUBLE - 1))
    assert made.lost(NS_PER_S + 2 * PERIOD) == 1


def test_the_first_answer_at_all_is_no_copy() -> None:
    made = Losses(PERIOD, TIMEOUT, WINDOW)
    made.on_answer(0)  # without a poll
    made.on_poll(1)
    made.on_answer(2)
    made.on_poll(PERIOD)
    assert made.lost(PERIOD) == 0


def test_every_third_answer_lost_shows_three_or_four_in_the_window() -> None:
    polls = [NS_PER_S + n * PERIOD for n in range(60)]
    answers = [at + 2 * MS for n, at in enumerate(polls) if n % 3]
    counts = [count for _, count in replay(polls, answers)]
    assert set(counts[12:]) == {3, 4}


spacings = st.lists(st.integers(10, 400), min_size=1, max_size=60)  # ms: our own pauses


@given(st.data(), spacings)
def test_without_late_answers_the_count_is_exact(data: st.DataObject, spacing: list[int]) -> None:
    """Dropped, doubled, and with pauses of our own: exactly the dropped polls count."""
    polls = [NS_PER_S]
    for ms in spacing:
        polls.append(polls[-1] + ms * MS)
    fates = data.draw(st.lists(st.integers(0, 2), min_size=len(polls), max_size=len(polls)))
    trips = data.draw(st.lists(st.integers(1, 7), min_size=len(polls), max_size=len(polls)))
    answers = [
        at + trip * MS + copy
        for at, fate, trip in zip(polls, fates, trips, strict=True)
        for copy in (0, DOUBLE - 1)[:fate]
    ]
    for number, (at, count) in enumerate(replay(polls, answers)):
        ends = zip(polls[1 : number + 1], fates, strict=False)
        assert count == sum(fate == 0 and at - end <= WINDOW for end, fate in ends)


@given(st.integers(0, 99), st.integers(20, 60))
def test_a_constant_delay_is_no_loss(delay_ms: int, number: int) -> None:
    polls = [NS_PER_S + n * PERIOD for n in range(number)]
    answers = [at + delay_ms * MS + 1 for at in polls]
    for at, count in replay(polls, answers):
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


@given(st.lists(st.booleans(), min_size=1, max_size=80), st.integers(1, 200))
def test_no_answer_is_more_than_all_and_the_total_only_shrinks_by_late_ones(
    answered: list[bool], trip_ms: int
) -> None:
    polls = [NS_PER_S + n * PERIOD for n in range(len(answered))]
    answers = [at + trip_ms * MS for at, came in zip(polls, answered, strict=True) if came]
    for _, count in replay(polls, answers):
        assert 0 <= count <= WINDOW // PERIOD + 1


def test_every_lost_poll_counts_in_total() -> None:
    made = losses()
    for number in range(4):
        made.on_poll(NS_PER_S + number * PERIOD)
    assert made.total == 3


def test_an_answer_an_eighth_of_a_period_behind_another_is_no_copy() -> None:
    made = Losses(PERIOD + 1, TIMEOUT, WINDOW)
    for number in range(3):
        made.on_poll(NS_PER_S + number * PERIOD)
    for behind_ns in (0, DOUBLE):
        made.on_answer(NS_PER_S + 2 * PERIOD + MS + behind_ns)
    assert made.lost(NS_PER_S + 3 * PERIOD) == 1
