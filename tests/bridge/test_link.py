"""Whether the board is there."""

import pytest

from common.freshness import NS_PER_S
from services.bridge.link import Link, on_frame, on_tick

MS = NS_PER_S // 1000
SILENCE = 200 * MS
UP = Link("up", heard_ns=NS_PER_S)


def test_the_first_frame_brings_it_up() -> None:
    assert on_frame(Link(), NS_PER_S) == Link("up", heard_ns=NS_PER_S, up_ns=NS_PER_S)


@pytest.mark.parametrize(("age", "state"), [(SILENCE, "up"), (SILENCE + 1, "lost")])
def test_silence_loses_the_link(age: int, state: str) -> None:
    assert on_tick(UP, NS_PER_S + age, SILENCE).state == state


def test_never_stays_never_and_lost_comes_back() -> None:
    assert on_tick(Link(), 9 * NS_PER_S, SILENCE).state == "never"
    lost = on_tick(UP, 9 * NS_PER_S, SILENCE)
    assert on_tick(lost, 10 * NS_PER_S, SILENCE) == lost
    back = on_frame(lost, 10 * NS_PER_S)
    assert (back.state, back.up_ns) == ("up", 10 * NS_PER_S)
    assert on_frame(back, 11 * NS_PER_S).up_ns == 10 * NS_PER_S
