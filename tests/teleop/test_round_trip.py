"""The bound on the age of a key, from the queries that the terminal answers."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.freshness import NS_PER_S
from services.teleop.core.round_trip import (
    NUMBERS,
    PROBE_S,
    RECOVER_S,
    UNKNOWN,
    RoundTrip,
)

LIMIT_S = 0.15


def at(seconds: float) -> int:
    return round(seconds * NS_PER_S)


@pytest.fixture
def trip() -> RoundTrip:
    return RoundTrip(LIMIT_S)


def probe(trip: RoundTrip, number: int, sent_s: float, took_s: float) -> None:
    trip.sent(number, at(sent_s))
    trip.answered(number, at(sent_s + took_s))


def test_before_the_first_answer_the_delay_is_unknown(trip: RoundTrip) -> None:
    assert trip.refusal(at(10)) == UNKNOWN
    trip.sent(1, at(10))
    assert trip.refusal(at(10)) == UNKNOWN


@pytest.mark.parametrize(("took_s", "counts"), [(0.0, True), (0.15, True), (0.151, False)])
def test_the_limit_applies_to_the_round_trip(trip: RoundTrip, took_s: float, counts: bool) -> None:
    probe(trip, 1, 10, took_s)
    assert (trip.refusal(at(10 + took_s)) == "") is counts


def test_a_refusal_names_the_round_trip_and_the_limit(trip: RoundTrip) -> None:
    probe(trip, 1, 10, 0.42)
    assert trip.refusal(at(10.42)) == "terminal too slow: 0.42 s, allowed 0.15 s"


def test_a_key_before_the_answer_may_be_older_than_the_query(trip: RoundTrip) -> None:
    probe(trip, 1, 10, 0.1)
    assert trip.refusal(at(10.099)) == UNKNOWN
    assert trip.refusal(at(10.1)) == ""


def test_silence_counts_as_slow(trip: RoundTrip) -> None:
    probe(trip, 1, 10, 0.01)
    last_s = 10 + LIMIT_S + 2 * PROBE_S
    assert trip.refusal(at(last_s)) == ""
    assert "too slow: 0.16 s" in trip.refusal(at(last_s + 0.01))


def test_one_slow_answer_counts_for_a_while(trip: RoundTrip) -> None:
    probe(trip, 1, 10, 0.5)
    for number in range(2, 30):
        probe(trip, number, 10.5 + number * PROBE_S, 0.01)
    assert "0.50 s" in trip.refusal(at(10.5 + RECOVER_S))
    assert trip.refusal(at(10.501 + RECOVER_S)) == ""


def test_answers_out_of_order_and_unknown_ones_are_ignored(trip: RoundTrip) -> None:
    for number in (1, 2, 3):
        trip.sent(number, at(10 + number / 10))
    trip.answered(9, at(10.31))
    assert trip.refusal(at(10.31)) == UNKNOWN
    trip.answered(2, at(10.32))
    trip.answered(1, at(10.33))  # older than one that was answered: a stream has an order
    assert trip.refusal(at(10.33)) == ""
    trip.answered(2, at(12))  # twice
    assert "too slow" in trip.refusal(at(12))
    trip.answered(3, at(12))
    assert "1.70 s" in trip.refusal(at(12))


def test_a_reused_number_is_the_new_query(trip: RoundTrip) -> None:
    for question in range(2 * NUMBERS):
        trip.sent(question % NUMBERS, at(10 + question * PROBE_S))
    last_s = 10 + (2 * NUMBERS - 1) * PROBE_S
    trip.answered(NUMBERS - 1, at(last_s + 0.1))
    assert trip.refusal(at(last_s + 0.1)) == ""


def test_stored_answers_are_bounded(trip: RoundTrip) -> None:
    for number in range(3 * NUMBERS):
        probe(trip, number, 10 + number, 0.01)
    assert len(trip._answers) == NUMBERS


DELAYS = st.lists(st.floats(0.0, 2.0) | st.floats(0.0, 0.1), min_size=5, max_size=60)


@given(there=DELAYS, back=DELAYS, way=st.floats(0.0, 1.0))
def test_no_key_that_counts_is_older_than_the_limit_allows(
    there: list[float], back: list[float], way: float
) -> None:
    """Delays of any size, but each direction in order: what was typed long ago never counts."""
    trip, answers = RoundTrip(LIMIT_S), [(0.0, 0.0)]  # typed, received
    for number, (down_s, up_s) in enumerate(zip(there, back, strict=False)):
        sent_s = 10 + number * PROBE_S
        trip.sent(number, at(sent_s))
        typed_s = max(answers[-1][0], sent_s + down_s)
        answers.append((typed_s, max(answers[-1][1], typed_s + up_s)))
    for number, ((typed_s, _), (next_s, received_s)) in enumerate(pairwise(answers)):
        # A key that was typed between two answers, and came with the second one.
        age_s = received_s - (typed_s + way * (next_s - typed_s))
        refused_before = trip.refusal(at(received_s) - 1)
        trip.answered(number, at(received_s))
        if age_s > LIMIT_S + 2 * PROBE_S + 0.001:
            assert refused_before
