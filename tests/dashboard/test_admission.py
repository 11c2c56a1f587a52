"""Limits of connections and messages: admission, reserve, rate limit."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.freshness import NS_PER_S
from services.dashboard.admission import Admission, Place, RateLimit, Verdict, network_of

ORDINARY, RESERVE = Place.ORDINARY, Place.RESERVE


@pytest.fixture
def admission() -> Admission:
    return Admission(total=4, per_network=2, reserve=2)


def test_one_network_reaches_its_own_limit(admission: Admission) -> None:
    assert admission.admit(1, "a") == (ORDINARY, None)
    assert admission.admit(2, "a") == (ORDINARY, None)
    assert admission.admit(3, "a") == (RESERVE, None)
    assert admission.admit(4, "b") == (ORDINARY, None)


def test_all_networks_reach_the_total_limit(admission: Admission) -> None:
    for number, network in enumerate("aabb"):
        assert admission.admit(number, network) == (ORDINARY, None)
    assert admission.admit(9, "c") == (RESERVE, None)


def test_the_oldest_connection_of_a_full_reserve_is_closed(admission: Admission) -> None:
    for number in (1, 2, 3, 4):
        admission.admit(number, "a")
    assert admission.admit(5, "a") == (RESERVE, 3)
    assert admission.admit(6, "a") == (RESERVE, 4)


def test_a_network_displaces_its_own_connections(admission: Admission) -> None:
    for number, network in enumerate("aabb"):
        admission.admit(number, network)
    admission.admit(10, "c")
    admission.admit(11, "a")
    assert admission.admit(12, "a") == (RESERVE, 11)
    assert admission.admit(13, "a") == (RESERVE, 12)


def test_a_closed_connection_frees_its_place(admission: Admission) -> None:
    admission.admit(1, "a")
    admission.admit(2, "a")
    admission.release(1)
    admission.release(1)
    assert admission.admit(3, "a") == (ORDINARY, None)


@given(st.lists(st.tuples(st.sampled_from("abc"), st.booleans()), max_size=60))
def test_the_limits_hold_and_a_new_connection_is_never_closed(
    steps: list[tuple[str, bool]],
) -> None:
    admission = Admission(total=4, per_network=2, reserve=2)
    inside: dict[int, tuple[str, Place]] = {}
    for number, (network, is_end) in enumerate(steps):
        if is_end and inside:
            gone = next(iter(inside))
            del inside[gone]
            admission.release(gone)
            continue
        place, ended = admission.admit(number, network)
        inside[number] = (network, place)
        if ended is not None:
            assert ended != number
            assert inside.pop(ended)[1] is RESERVE
        ordinary = [whose for whose, where in inside.values() if where is ORDINARY]
        assert len(ordinary) <= 4
        assert all(ordinary.count(whose) <= 2 for whose in "abc")
        assert len(inside) - len(ordinary) <= 2


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("10.7.5.1", "10.7.5.1", True),
        ("10.7.5.1", "10.7.5.2", False),
        ("::ffff:10.7.5.1", "10.7.5.1", True),
        ("2001:db8::1", "2001:db8::ffff:1", True),
        ("2001:db8:0:1::1", "2001:db8:0:2::1", False),
        ("fe80::1%eth0", "fe80::2%eth0", True),
    ],
)
def test_the_network_of_an_address(one: str, other: str, same: bool) -> None:
    assert (network_of(one) == network_of(other)) is same


ACCEPTED, DROPPED, ABUSIVE = Verdict.ACCEPTED, Verdict.DROPPED, Verdict.ABUSIVE


def test_a_burst_is_accepted_then_dropped_then_abusive() -> None:
    limit = RateLimit(rate=10, burst=3)
    assert [limit.take(0) for _ in range(6)] == [
        ACCEPTED, ACCEPTED, ACCEPTED, DROPPED, DROPPED, ABUSIVE,
    ]  # fmt: skip


def test_the_allowed_rate_is_always_accepted() -> None:
    limit = RateLimit(rate=10, burst=3)
    assert {limit.take(tick * NS_PER_S // 10) for tick in range(1000)} == {ACCEPTED}


def test_a_pause_refills_one_burst_at_most() -> None:
    limit = RateLimit(rate=10, burst=3)
    limit.take(0)
    assert [limit.take(3600 * NS_PER_S) for _ in range(4)] == [ACCEPTED] * 3 + [DROPPED]


def test_a_client_that_returns_to_the_rate_is_accepted() -> None:
    limit = RateLimit(rate=10, burst=3)
    for _ in range(5):
        limit.take(0)
    assert limit.take(NS_PER_S // 2) is ACCEPTED


def test_a_debt_is_bounded() -> None:
    limit = RateLimit(rate=10, burst=3)
    for _ in range(1000):
        limit.take(0)
    assert limit.take(NS_PER_S // 2) is ACCEPTED


@pytest.mark.parametrize(("cost", "verdict"), [(3, ACCEPTED), (4, DROPPED), (6, ABUSIVE)])
def test_a_cost_takes_more_than_one_token(cost: float, verdict: Verdict) -> None:
    assert RateLimit(rate=10, burst=3).take(0, cost) is verdict


@given(st.lists(st.integers(0, NS_PER_S), min_size=1, max_size=200))
def test_accepted_messages_are_bounded_by_rate_and_burst(waits: list[int]) -> None:
    limit, now_ns, accepted = RateLimit(rate=10, burst=3), 0, 0
    for wait_ns in waits:
        now_ns += wait_ns
        accepted += limit.take(now_ns) is ACCEPTED
    past_s = (now_ns - waits[0]) / NS_PER_S
    assert accepted <= 3 + 10 * past_s + 1e-6
