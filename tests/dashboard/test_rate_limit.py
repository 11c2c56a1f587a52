"""Messages of one connection: what is accepted, dropped and closed, and when."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.freshness import NS_PER_S
from services.dashboard.rate_limit import RateLimit, Verdict

ACCEPTED, DROPPED, ABUSIVE = Verdict.ACCEPTED, Verdict.DROPPED, Verdict.ABUSIVE


def test_a_burst_is_accepted_then_dropped_then_abusive() -> None:
    limit = RateLimit(rate=10, burst=3)
    assert [limit.take(0) for _ in range(6)] == [
        ACCEPTED, ACCEPTED, ACCEPTED, DROPPED, DROPPED, ABUSIVE,
    ]  # fmt: skip


def test_the_rate_is_accepted_for_ever() -> None:
    limit = RateLimit(rate=10, burst=3)
    assert {limit.take(tick * NS_PER_S // 10) for tick in range(1000)} == {ACCEPTED}


def test_a_pause_fills_one_burst_and_no_more() -> None:
    limit = RateLimit(rate=10, burst=3)
    limit.take(0)
    assert [limit.take(3600 * NS_PER_S) for _ in range(4)] == [ACCEPTED] * 3 + [DROPPED]


def test_who_slows_down_in_time_is_forgiven() -> None:
    limit = RateLimit(rate=10, burst=3)
    for _ in range(5):
        limit.take(0)
    assert limit.take(NS_PER_S // 2) is ACCEPTED


def test_a_debt_has_an_end() -> None:
    limit = RateLimit(rate=10, burst=3)
    for _ in range(1000):
        limit.take(0)
    assert limit.take(NS_PER_S // 2) is ACCEPTED


@pytest.mark.parametrize(("cost", "verdict"), [(3, ACCEPTED), (4, DROPPED), (6, ABUSIVE)])
def test_a_cost_takes_more_than_one_token(cost: float, verdict: Verdict) -> None:
    assert RateLimit(rate=10, burst=3).take(0, cost) is verdict


@given(st.lists(st.integers(0, NS_PER_S), min_size=1, max_size=200))
def test_never_more_than_rate_and_burst(waits: list[int]) -> None:
    limit, now_ns, accepted = RateLimit(rate=10, burst=3), 0, 0
    for wait_ns in waits:
        now_ns += wait_ns
        accepted += limit.take(now_ns) is ACCEPTED
    past_s = (now_ns - waits[0]) / NS_PER_S
    assert accepted <= 3 + 10 * past_s + 1e-6
