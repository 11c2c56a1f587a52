"""The bound on the age of a keystroke, from the queries that the terminal answers."""

from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.freshness import NS_PER_S
from services.teleop.core.round_trip import (
    ANSWERS,
    QUERY_S,
    RECOVER_S,
    STOPPED_S,
    UNKNOWN,
    RoundTrip,
    place,
)
from t2.messages import Phrase, Phrases

LIMIT_S = 0.15


def at(seconds: float) -> int:
    return round(seconds * NS_PER_S)


@pytest.fixture
def trip() -> RoundTrip:
    return RoundTrip(LIMIT_S)


def slow(delay_s: float) -> Phrases:
    delay: Any = pytest.approx(delay_s)
    return (Phrase("terminal.slow", {"delay": delay, "limit": LIMIT_S}),)


def query(trip: RoundTrip, number: int, sent_s: float, took_s: float) -> None:
    trip.sent((number, 1), at(sent_s))
    trip.answered((number, 1), at(sent_s + took_s))


def test_a_terminal_has_stopped_a_second_after_its_last_answer(trip: RoundTrip) -> None:
    trip.sent((1, 1), at(1.0))
    assert not trip.has_stopped(at(60.0))  # one that never answers
    trip.answered((1, 1), at(2.0))
    assert not trip.has_stopped(at(2.0 + STOPPED_S))
    assert trip.has_stopped(at(2.001 + STOPPED_S))


SLOW_ONCE = [(10.0, 0.5), *((10.5 + number * QUERY_S, 0.01) for number in range(2, 30))]


@pytest.mark.parametrize(
    ("answers", "at_s", "refusal"),
    [
        ([], 10.0, UNKNOWN),
        ([(10.0, 0.0)], 10.0, ()),
        ([(10.0, 0.15)], 10.15, ()),
        ([(10.0, 0.151)], 10.151, slow(0.151)),
        ([(10.0, 0.42)], 10.42, slow(0.42)),
        ([(10.0, 0.1)], 10.099, UNKNOWN),  # may be older than the query
        ([(10.0, 0.01)], 10 + LIMIT_S + 2 * QUERY_S, ()),
        ([(10.0, 0.01)], 10.01 + LIMIT_S + 2 * QUERY_S, slow(0.16)),  # silence
        (SLOW_ONCE, 10.5 + RECOVER_S, slow(0.5)),
        (SLOW_ONCE, 10.501 + RECOVER_S, ()),
    ],
)
def test_a_key_is_refused_by_the_answers_before_it(
    trip: RoundTrip, answers: list[tuple[float, float]], at_s: float, refusal: Phrases
) -> None:
    trip.sent((0, 1), at(9.9))  # without an answer
    for number, (sent_s, took_s) in enumerate(answers, 1):
        query(trip, number, sent_s, took_s)
    assert trip.refusal(at(at_s)) == refusal


def test_answers_out_of_order_and_unknown_ones_are_ignored(trip: RoundTrip) -> None:
    for number in (1, 2, 3):
        trip.sent((number, 1), at(10 + number / 10))
    trip.answered((9, 1), at(10.31))
    assert trip.refusal(at(10.31)) == UNKNOWN
    trip.answered((2, 1), at(10.32))
    trip.answered((1, 1), at(10.33))  # older than one that was answered: a stream has an order
    assert trip.refusal(at(10.33)) == ()
    trip.answered((2, 1), at(12))  # twice
    assert trip.refusal(at(12)) == slow(1.6)
    trip.answered((3, 1), at(12))
    assert trip.refusal(at(12)) == slow(1.7)


DELAYS = st.lists(st.floats(0.0, 2.0) | st.floats(0.0, 0.1), min_size=5, max_size=60)


@given(there=DELAYS, back=DELAYS, way=st.floats(0.0, 1.0))
def test_no_key_that_counts_is_older_than_the_limit_allows(
    there: list[float], back: list[float], way: float
) -> None:
    """Delays of any size, but each direction in order: what was typed long ago never counts."""
    trip, answers = RoundTrip(LIMIT_S), [(0.0, 0.0)]  # typed, received
    for number, (down_s, up_s) in enumerate(zip(there, back, strict=False)):
        sent_s = 10 + number * QUERY_S
        trip.sent((number, 1), at(sent_s))
        typed_s = max(answers[-1][0], sent_s + down_s)
        answers.append((typed_s, max(answers[-1][1], typed_s + up_s)))
    for number, ((typed_s, _), (next_s, received_s)) in enumerate(pairwise(answers)):
        # A key that was typed between two answers, and came with the second one.
        age_s = received_s - (typed_s + way * (next_s - typed_s))
        refused_before = trip.refusal(at(received_s) - 1)
        trip.answered((number, 1), at(received_s))
        if age_s > LIMIT_S + 2 * QUERY_S + 0.001:
            assert refused_before


def test_stored_answers_are_bounded(trip: RoundTrip) -> None:
    for number in range(3 * ANSWERS):
        query(trip, number, 10 + number, 0.01)
    assert len(trip._answers) == ANSWERS


@pytest.mark.parametrize(("width", "height"), [(40, 20), (80, 24), (20, 5)])
@pytest.mark.parametrize("behind", [0, 1])
def test_no_slow_answer_is_taken_for_that_of_a_later_query(
    trip: RoundTrip, width: int, height: int, behind: int
) -> None:
    """A steady delay of the time in which a row, or 64 queries, pass by."""
    for late in (width + behind, 64 + behind):
        for query in range(1, 3 * late):
            trip.sent(place(query, width, height), at(query * QUERY_S))
            if query > late:
                trip.answered(place(query - late, width, height), at(query * QUERY_S + 0.05))
                (reason,) = trip.refusal(at(query * QUERY_S + 0.06))
                assert reason.name == "terminal.slow"


def test_the_places_of_queries() -> None:
    assert [place(query, 3, 3) for query in range(7)] == [
        (0, 1), (1, 1), (2, 1), (0, 2), (1, 2), (2, 2), (0, 1),
    ]  # fmt: skip
    assert [place(query, 0, 1) for query in range(2)] == [(0, 1), (0, 1)]
    assert place(5, 1, 2) == (0, 1)
