"""Which query is due and which answer is overdue."""

from common.freshness import NS_PER_S
from common.wire.commands import BumperQuery, DistanceQuery
from common.wire.frame import Frame
from services.bridge.poll import SLOWEST, Poll

MS = NS_PER_S // 1000


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
    polled.answered("bumper", NS_PER_S)
    assert polled.round_trip_s() is None
    polled.due(NS_PER_S)
    polled.answered("bumper", NS_PER_S + 250 * MS)
    assert polled.round_trip_s() == 0.25


def test_an_answer_is_no_older_than_its_question() -> None:
    polled = poll()
    polled.due(NS_PER_S)
    assert polled.answered("bumper", NS_PER_S + 300 * MS) == NS_PER_S
    assert polled.answered("bumper", NS_PER_S + 310 * MS) == NS_PER_S + 310 * MS


def test_a_slow_query_that_is_never_answered_gets_slower_to_a_quarter() -> None:
    polled = Poll([("slow", BumperQuery(), 2.0)], 0.1)
    times = [1000, 1500, 2500, 4500, 6500]
    assert sent(polled, "slow", range(1000, 7000, 10)) == times
    assert polled.missed() == {"slow": 5}


def test_the_round_trip_is_the_median_of_the_queries() -> None:
    names = "abcde"
    polled = Poll([(name, BumperQuery(), 1.0) for name in names], 0.1)
    polled.due(NS_PER_S)
    for n, name in enumerate(names):
        polled.answered(name, NS_PER_S + (n + 1) * MS)
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


def test_a_query_is_sent_at_the_nearest_tick() -> None:
    polled = Poll([("bumper", BumperQuery(), 50.0)], 0.1, tick_s=0.02)
    for tick in (1001, 1020, 1041, 1059, 1080):  # jitter of a millisecond costs no poll
        assert polled.due(tick * MS), tick
        polled.answered("bumper", tick * MS)


def test_a_query_is_at_most_half_a_tick_early() -> None:
    polled = Poll([("bumper", BumperQuery(), 50.0)], 0.1, tick_s=0.02)
    polled.due(1000 * MS)
    polled.answered("bumper", 1001 * MS)
    assert not polled.due(1010 * MS - 1)
    assert polled.due(1010 * MS)


def test_after_a_late_tick_the_answer_has_half_a_period() -> None:
    polled = Poll([("bumper", BumperQuery(), 50.0)], 0.1, ("bumper",), tick_s=0.02)
    polled.due(1000 * MS)
    polled.answered("bumper", 1004 * MS)
    assert polled.due(1039 * MS)  # 19 ms late
    assert not polled.due(1040 * MS)
    polled.answered("bumper", 1043 * MS)
    assert polled.due(1060 * MS)
    assert polled.lost("bumper", 1060 * MS) == 0


# --- steady queries -----------------------------------------------------------------------------


def steady() -> Poll:
    queries = [("bumper", BumperQuery(), 50.0), ("mileage", DistanceQuery(), 50.0)]
    return Poll(queries, 0.1, ("bumper",))


def test_a_steady_query_keeps_its_rate_without_any_answer() -> None:
    polled = steady()
    times = [tick for tick in range(1000, 2000, 10) if BumperQuery() in polled.due(tick * MS)]
    assert times == list(range(1000, 2000, 20))
    assert polled.queries["bumper"].slowdown == 1
    assert (polled.lost("bumper", 1980 * MS), polled.missed()["bumper"]) == (11, 49)
    assert polled.queries["mileage"].losses is None
    assert polled.lost("mileage", 2 * NS_PER_S) == 0


def test_every_third_answer_lost_keeps_the_rate_and_shows() -> None:
    polled = steady()
    asked, seen = 0, []
    for tick in range(1000, 2000, 10):
        if BumperQuery() in polled.due(tick * MS):
            asked += 1
            if asked % 3:
                polled.answered("bumper", (tick + 2) * MS)
                seen.append(polled.lost("bumper", (tick + 2) * MS))
    assert asked == 50
    assert set(seen[10:]) == {3, 4}


def test_a_process_that_is_held_up_loses_nothing() -> None:
    polled = steady()
    for tick in (1000, 1020, 1340, 1350, 1370, 1900):
        if BumperQuery() in polled.due(tick * MS):
            polled.answered("bumper", (tick + 5) * MS)
    assert polled.lost("bumper", 1900 * MS) == 0
    assert polled.missed() == {"mileage": 2}


def test_a_late_poll_is_not_followed_at_once_by_the_next() -> None:
    polled = steady()
    query = polled.queries["bumper"]
    for tick, next_tick in ((1000, 1020), (1025, 1040), (1045, 1060), (1075, 1085), (1105, 1125)):
        polled.due(tick * MS)
        assert query.due_ns == next_tick * MS


def test_an_answer_after_a_loss_may_be_that_of_the_poll_before() -> None:
    polled = steady()
    polled.due(NS_PER_S)
    polled.due(NS_PER_S + 20 * MS)
    assert polled.answered("bumper", NS_PER_S + 22 * MS) == NS_PER_S
    polled.due(NS_PER_S + 40 * MS)
    assert polled.answered("bumper", NS_PER_S + 42 * MS) == NS_PER_S + 40 * MS
    for tick in range(1060, 1180, 20):
        polled.due(tick * MS)
    assert polled.answered("bumper", NS_PER_S + 162 * MS) == NS_PER_S + 160 * MS, (
        "not beyond the timeout"
    )


def test_a_steady_query_counts_lost_polls_and_takes_a_late_answer_back() -> None:
    polled = Poll([("bumper", BumperQuery(), 50.0)], 0.1, ("bumper",))
    for tick in (1000, 1020, 1040):
        assert polled.due(tick * MS) == [BumperQuery()]
    assert polled.lost("bumper", 1040 * MS) == 2
    for tick in (1045, 1055):
        polled.answered("bumper", tick * MS)
    assert polled.lost("bumper", 1055 * MS) == 1
    polled.due(1075 * MS)  # late
    assert polled.due(1080 * MS) == []
    assert polled.queries["bumper"].due_ns == 1085 * MS
    assert isinstance(polled.queries["bumper"].due_ns, int)
