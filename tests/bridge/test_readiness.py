"""Whether the board is there."""

import pytest

from common.freshness import NS_PER_S
from services.bridge.readiness import Link, link_on_frame, link_on_tick

MS = NS_PER_S // 1000
SILENCE = 200 * MS
UP = Link("up", received_ns=NS_PER_S)


def test_the_first_frame_brings_it_up() -> None:
    assert link_on_frame(Link(), NS_PER_S) == Link("up", received_ns=NS_PER_S, up_ns=NS_PER_S)


@pytest.mark.parametrize(("age", "state"), [(SILENCE, "up"), (SILENCE + 1, "lost")])
def test_silence_loses_the_link(age: int, state: str) -> None:
    assert link_on_tick(UP, NS_PER_S + age, SILENCE).state == state


def test_never_stays_never_and_lost_comes_back() -> None:
    assert link_on_tick(Link(), 9 * NS_PER_S, SILENCE).state == "never"
    lost = link_on_tick(UP, 9 * NS_PER_S, SILENCE)
    assert link_on_tick(lost, 10 * NS_PER_S, SILENCE) == lost
    back = link_on_frame(lost, 10 * NS_PER_S)
    assert (back.state, back.up_ns) == ("up", 10 * NS_PER_S)
    assert link_on_frame(back, 11 * NS_PER_S).up_ns == 10 * NS_PER_S
