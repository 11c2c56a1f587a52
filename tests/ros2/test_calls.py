"""Resets that the network held back."""

import pytest

from common.freshness import NS_PER_S
from common.messages import Cause, SafetyState
from services.ros2.calls import TOLERANCE_S, reset_refusal
from tests.factories import safety_state

NOW_NS = 1_700_000_000 * NS_PER_S


def state(**ages_s: float) -> SafetyState:
    causes = [Cause(name=name, action="brake", age=age, text="") for name, age in ages_s.items()]
    latched = tuple(name for name in ages_s if name != "no_request")
    return safety_state(causes=tuple(causes), latched=latched)


def refusal(seen: SafetyState, sent_s_ago: float) -> str:
    return reset_refusal(seen, NOW_NS - round(sent_s_ago * NS_PER_S), NOW_NS)


def test_a_reset_that_was_sent_after_the_stop_counts() -> None:
    assert not refusal(state(estop=3.0), 2.7)


def test_a_reset_that_was_sent_before_the_stop_is_refused() -> None:
    text = refusal(state(estop=2.0), 4.3)
    assert "4.3 s ago" in text
    assert "2.0 s ago" in text


def test_the_newest_stop_counts() -> None:
    assert refusal(state(contact=60.0, estop=2.0), 3.0)
    assert not refusal(state(contact=60.0, estop=30.0), 3.0)


def test_only_what_is_latched_counts() -> None:
    assert not refusal(state(estop=30.0, no_request=1.0), 3.0)


@pytest.mark.parametrize("latched_s", [0.0, 0.1, 0.19])
def test_nobody_has_seen_a_stop_that_is_so_new(latched_s: float) -> None:
    assert "Reset again" in refusal(state(estop=latched_s), 0.0)
    assert refusal(state(estop=latched_s), -0.15)


def test_clocks_may_differ_a_little() -> None:
    assert not refusal(state(estop=1.0), 0.8)
    assert refusal(state(estop=1.0), 0.81)
    assert not refusal(state(estop=TOLERANCE_S), 0.0)


@pytest.mark.parametrize(("ahead_s", "refused"), [(0.1, False), (0.2, False), (0.3, True)])
def test_a_clock_that_is_ahead_hides_the_age_of_a_call(ahead_s: float, refused: bool) -> None:
    text = refusal(state(estop=2.0), -ahead_s)
    assert ("0.3 s ahead" in text) == refused
    assert bool(text) == refused


def test_without_a_latch_safety_answers() -> None:
    assert not refusal(state(no_request=1.0), 3600.0)
