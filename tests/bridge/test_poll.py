"""Which query is due and which answer is overdue."""

from common.freshness import S
from common.wire.commands import BumperQuery, DistanceQuery
from common.wire.frame import Frame
from services.bridge.poll import SLOWEST, Poll

MS = S // 1000


def poll() -> Poll:
    return Poll([("bumper", BumperQuery(), 50.0), ("mileage", DistanceQuery(), 10.0)], 0.1)


def sent(poll: Poll, name: str, ticks: range) -> list[int]:
    """Tick at these milliseconds, answer all but ``name``, and return when that was sent."""
    frame = poll.queries[name].frame
    times = []
    for tick in ticks:
        due = poll.due(tick * MS)
        if frame in due:
            times.append(tick)
        for other in set(poll.queries) - {name}:
            poll.answered(other, tick * MS)
    return times


def test_each_at_its_own_rate_when_answers_come() -> None:
    polled = poll()
    counts: dict[Frame, int] = {BumperQuery(): 0, DistanceQuery(): 0}
    for tick in range(1000, 2000, 10):
        for frame in polled.due(tick * MS):
            counts[frame] += 1
        for name in polled.queries:
            polled.answered(name, tick * MS + 3 * MS)
    assert counts == {BumperQuery(): 50, DistanceQuery(): 10}
    assert polled.round_trip_s() == 0.003
    assert polled.missed() == {}


def test_one_open_query_of_a_kind() -> None:
    polled = poll()
    assert sent(polled, "bumper", range(1000, 1100, 10)) == [1000]


def test_a_missed_answer_halves_the_rate_down_to_a_quarter_and_the_next_restores_it() -> None:
    polled = poll()
    assert sent(polled, "bumper", range(1000, 1500, 10)) == [1000, 1100, 1200, 1300, 1400]
    assert polled.missed() == {"bumper": 4}
    assert polled.queries["bumper"].slowdown == SLOWEST
    polled.answered("bumper", 1490 * MS)
    assert polled.queries["bumper"].slowdown == 1
    assert sent(polled, "bumper", range(1500, 1510, 10)) == [1500]


def test_a_late_answer_still_counts_and_an_unasked_one_changes_nothing() -> None:
    polled = poll()
    polled.answered("bumper", S)
    assert polled.round_trip_s() is None
    polled.due(S)
    polled.answered("bumper", S + 250 * MS)
    assert polled.round_trip_s() == 0.25


def test_an_answer_is_no_older_than_its_question() -> None:
    polled = poll()
    polled.due(S)
    assert polled.answered("bumper", S + 300 * MS) == S
    assert polled.answered("bumper", S + 310 * MS) == S + 310 * MS


def test_a_slow_query_that_is_never_answered_gets_slower_to_a_quarter() -> None:
    polled = Poll([("slow", BumperQuery(), 2.0)], 0.1)
    times = [1000, 1500, 2500, 4500, 6500]
    assert sent(polled, "slow", range(1000, 7000, 10)) == times
    assert polled.missed() == {"slow": 5}


def test_the_round_trip_is_the_median_of_the_queries() -> None:
    names = "abcde"
    polled = Poll([(name, BumperQuery(), 1.0) for name in names], 0.1)
    polled.due(S)
    for n, name in enumerate(names):
        polled.answered(name, S + (n + 1) * MS)
    assert polled.round_trip_s() == 0.003


def test_the_beat_is_kept_while_it_is_less_than_a_period_late() -> None:
    polled = poll()
    query = polled.queries["bumper"]
    for tick, next_tick in ((1000, 1020), (1023, 1040), (1059, 1060), (1080, 1100)):
        polled.due(tick * MS)
        polled.answered("bumper", tick * MS)
        assert query.due_ns == next_tick * MS


def test_a_pause_is_not_caught_up_in_a_burst() -> None:
    polled = poll()
    for tick in (1000, 5000, 5010, 5020):
        polled.due(tick * MS)
        polled.answered("bumper", tick * MS)
    assert polled.queries["bumper"].due_ns == 5040 * MS
