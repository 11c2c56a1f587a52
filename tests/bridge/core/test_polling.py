"""Which query is due, and the round trip of its answer."""

import pytest

from common.freshness import NS_PER_S
from common.wire.commands import BumperQuery, DistanceQuery
from common.wire.frame import Frame
from services.bridge.core.polling import Polling

MS = NS_PER_S // 1000


def polling() -> Polling:
    return Polling([("bumper", BumperQuery(), 50.0), ("mileage", DistanceQuery(), 10.0)], 0.1)


def test_each_at_its_own_rate_when_answers_come() -> None:
    polled = polling()
    counts: dict[Frame, int] = {BumperQuery(): 0, DistanceQuery(): 0}
    for tick in range(1000, 2000, 10):
        for frame in polled.due(tick * MS):
            counts[frame] += 1
        for name in polled.queries:
            polled.answered(name, tick * MS + 3 * MS)
    assert counts == {BumperQuery(): 50, DistanceQuery(): 10}
    assert polled.round_trip_s() == 0.003


def test_an_answer_or_none_leaves_the_rate() -> None:
    polled = polling()
    times = [tick for tick in range(1000, 2000, 10) if BumperQuery() in polled.due(tick * MS)]
    assert times == list(range(1000, 2000, 20))


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


def test_an_answer_after_a_loss_may_be_that_of_the_poll_before() -> None:
    polled = polling()
    polled.due(NS_PER_S)
    polled.due(NS_PER_S + 20 * MS)
    assert polled.answered("bumper", NS_PER_S + 22 * MS) == NS_PER_S
    for tick in range(1040, 1180, 20):
        polled.due(tick * MS)
    late = "not beyond the timeout"
    assert polled.answered("bumper", NS_PER_S + 162 * MS) == NS_PER_S + 140 * MS, late
