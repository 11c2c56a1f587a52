"""Wrong tokens are limited per address and in all, and keep no operator out."""

from common.freshness import NS_PER_S
from services.dashboard.guess_limit import (
    ADDRESSES_MAX,
    ALL_BURST,
    ALL_PERIOD_S,
    BURST,
    PERIOD_S,
    WRONG_MAX,
    GuessLimit,
    network,
)

NOW_NS = 1000 * NS_PER_S


def guess(limit: GuessLimit, host: str, token: str, now_ns: int = NOW_NS) -> bool:
    """Try a wrong token; return whether it was compared."""
    if limit.wait_s(host, token, now_ns):
        return False
    limit.compared(host, token, now_ns, is_right=False)
    return True


def test_an_address_has_some_guesses_at_once_and_then_one_in_each_period() -> None:
    limit = GuessLimit()
    compared = [guess(limit, "10.0.0.1", f"{n}") for n in range(BURST + 10)]
    assert compared == [True] * BURST + [False] * 10
    assert limit.wait_s("10.0.0.1", "next", NOW_NS) == PERIOD_S
    later_ns = NOW_NS + round(PERIOD_S * NS_PER_S)
    assert guess(limit, "10.0.0.1", "a", later_ns)
    assert not guess(limit, "10.0.0.1", "b", later_ns)


def test_many_addresses_share_a_limit_that_a_known_operator_does_not_have() -> None:
    limit = GuessLimit()
    limit.compared("10.0.0.9", "right", NOW_NS, is_right=True)
    compared = [guess(limit, f"10.0.1.{n}", f"{n}") for n in range(ALL_BURST + 10)]
    assert compared == [True] * ALL_BURST + [False] * 10
    assert limit.wait_s("10.0.0.8", "right", NOW_NS) == ALL_PERIOD_S
    assert limit.wait_s("10.0.0.9", "right", NOW_NS) == 0.0


def test_the_same_wrong_token_costs_once() -> None:
    limit = GuessLimit()
    assert all(guess(limit, "10.0.0.1", "old") for _ in range(100))
    assert guess(limit, "10.0.0.1", "other")


def test_what_is_remembered_is_bounded() -> None:
    limit = GuessLimit()
    for number in range(ADDRESSES_MAX + 1):
        limit.wait_s(f"host {number}", "x", NOW_NS)
    assert len(limit._addresses) == ADDRESSES_MAX
    for number in range(2 * WRONG_MAX):
        guess(limit, "10.0.0.1", f"{number}", NOW_NS + number * 10 * NS_PER_S)
    assert len(limit._addresses["10.0.0.1"].wrong) == WRONG_MAX


def test_a_host_is_one_address_however_it_is_written() -> None:
    assert network("2001:db8::1") == network("2001:db8::2:3") != network("2001:db8:0:1::1")
    assert network("fe80::1%eth0") == network("fe80::2%eth1")
    assert network("::ffff:10.0.0.1") == network("10.0.0.1") == "10.0.0.1"
    assert network("unknown") == "unknown"
