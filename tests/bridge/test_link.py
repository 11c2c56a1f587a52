"""The link and its two ports."""

import pytest

from common.freshness import S
from services.bridge.link import Link, believes, on_frame, on_tick

MS = S // 1000
SILENCE, FAILOVER = 200 * MS, 100 * MS
UP = Link("up", heard_ns=S, active=0)


@pytest.mark.parametrize("port", [0, 1])
def test_before_anything_was_heard_either_port_may_begin(port: int) -> None:
    assert believes(Link(), port, S, FAILOVER)
    assert on_frame(Link(), port, S) == Link("up", heard_ns=S, up_ns=S, active=port)


@pytest.mark.parametrize(("age", "taken"), [(0, False), (FAILOVER, False), (FAILOVER + 1, True)])
def test_the_other_port_counts_only_when_the_active_one_is_silent(age: int, taken: bool) -> None:
    assert believes(UP, 0, S + age, FAILOVER)
    assert believes(UP, 1, S + age, FAILOVER) is taken


def test_after_a_change_the_first_port_is_the_other_one() -> None:
    changed = on_frame(UP, 1, 2 * S)
    assert changed.active == 1
    assert not believes(changed, 0, 2 * S + MS, FAILOVER)


@pytest.mark.parametrize(("age", "state"), [(SILENCE, "up"), (SILENCE + 1, "lost")])
def test_silence_loses_the_link(age: int, state: str) -> None:
    assert on_tick(UP, S + age, SILENCE).state == state


def test_never_stays_never_and_lost_comes_back() -> None:
    assert on_tick(Link(), 9 * S, SILENCE).state == "never"
    lost = on_tick(UP, 9 * S, SILENCE)
    assert on_tick(lost, 10 * S, SILENCE) == lost
    back = on_frame(lost, 0, 10 * S)
    assert (back.state, back.up_ns) == ("up", 10 * S)
    assert on_frame(back, 0, 11 * S).up_ns == 10 * S
