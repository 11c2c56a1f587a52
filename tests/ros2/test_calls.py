"""Resets that the network held back, and those that safety's state does not confirm."""

import time
from types import SimpleNamespace
from typing import Any

import pytest

from common.freshness import NS_PER_S
from services.ros2.calls import TOLERANCE_S, Calls, reset_refusal
from services.ros2.cdr import Attachment
from services.ros2.config import Ros2Config
from t2.client import CONFIRM_S
from t2.messages import Cause, Phrase, Refusal, ResetDone, SafetyState
from tests.factories import safety_state

NOW_NS = 1_700_000_000 * NS_PER_S


def state(**ages_s: float) -> SafetyState:
    ages: dict[Any, float] = ages_s
    causes = [Cause(name=name, action="brake", age=age, text="") for name, age in ages.items()]
    latched = tuple(name for name in ages if name != "no_request")
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


class Bench:
    """The services, on a bus on which anybody may answer a reset."""

    def __init__(self) -> None:
        self.newest = state(estop=3.0)
        self.served: dict[str, Any] = {}
        self.ticks: list[Any] = []
        self.answers: list[Any] = []
        self.now_ns = 0
        self.refusal: Refusal | None = None  # the answer of safety
        node: Any = SimpleNamespace(
            bus=SimpleNamespace(call=self._call, estop=lambda: None),
            config=Ros2Config(),
            loop=SimpleNamespace(every=lambda _, tick: self.ticks.append(tick)),
        )
        ros: Any = SimpleNamespace(serve=lambda name, _, handle: self.served.update({name: handle}))
        Calls(node, ros, lambda name: name, lambda _: self.newest)

    def reset(self) -> None:
        """Call the service, as soon as the stop was seen."""
        about = Attachment(1, time.time_ns(), bytes(16))
        self.served["hardware/e_stop_reset"](about, (), self.answers.append)

    def tick(self, seconds: float) -> None:
        """Let time pass."""
        self.now_ns += round(seconds * NS_PER_S)
        self.ticks[0](self.now_ns)

    def _call(self, _: Any, request: Any, answered: Any, refused: Any) -> None:
        if self.refusal:
            refused(self.refusal)
            return
        phrases = (Phrase("reset.done"),)
        answered(ResetDone(text="Let go.", phrases=phrases, cleared=request.causes))


def test_a_reset_succeeds_when_safetys_state_shows_it() -> None:
    bench = Bench()
    bench.reset()
    bench.tick(0.05)
    assert bench.answers == []
    bench.newest = state()
    bench.tick(0.05)
    assert bench.answers == [(True, "Reset. Stop publishing for 0.5 s, then publish again.")]


def test_a_refused_reset_is_in_words_of_ros() -> None:
    bench = Bench()
    bench.refusal = Refusal(text="Let go.", phrases=(Phrase("reset.motion"),))
    bench.reset()
    ((success, text),) = bench.answers
    assert not success
    assert "stop publishing for 0.5 s" in text


def test_a_reset_that_only_a_stranger_answers_fails() -> None:
    bench = Bench()
    bench.reset()
    bench.tick(0.05)
    bench.tick(CONFIRM_S + 0.05)
    assert bench.answers == [(False, "Safety's state does not confirm it.")]
