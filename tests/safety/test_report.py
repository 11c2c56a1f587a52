"""Reports: texts, causes, limits, events on transitions only."""

from collections.abc import Callable

import pytest
from msgspec import ValidationError, convert
from msgspec.structs import replace

from services.safety.config import LimitSource, Safety, SafetyConfig, Source
from services.safety.core.state import State
from services.safety.report import (
    signature,
    summary,
    transitions,
)
from t2.codec import decode, encode
from t2.messages import MAX_REASON, MAX_TEXT, SONAR_NAMES, Limits, ResetRequest, SafetyState
from t2.words import render
from tests.safety.core.policy_fixture import BUMPER_FREE, PolicyFixture


def sentence_of(state: State) -> str:
    return render(summary(state))


def noted(fixture: PolicyFixture, step: Callable[[], object]) -> list[str]:
    """Take a step; return the events."""
    before = fixture.state
    step()
    return [note.name for note in transitions(before, fixture.state)]


def test_nothing_is_allowed_while_a_cause_is_latched() -> None:
    fixture = PolicyFixture().running()
    fixture.estop()
    assert fixture.published().limits == Limits(forward=0.0, backward=0.0, angular=0.0)
    fixture.tick(50)
    assert fixture.reset() == ""
    fixture.tick()
    assert fixture.published().limits.forward > 0.5  # a request is missing, nothing else


def test_one_sentence_says_why() -> None:
    fixture = PolicyFixture()
    assert sentence_of(fixture.state).startswith("Waiting for the first sample of: velocity,")
    fixture.tick(40)
    assert sentence_of(fixture.state) == "No command to drive."
    fixture.drive(0.5)
    assert sentence_of(fixture.state).startswith("Let go of the controls")
    fixture.drive()
    assert sentence_of(fixture.state) == "teleop (terminal) is in control."
    fixture.sonar(front=0.5)
    fixture.drive(0.5)
    assert (
        sentence_of(fixture.state)
        == "Slowed by an obstacle at 0.50 m (front). teleop (terminal) is in control."
    )
    fixture.pressed = True
    fixture.tick()
    assert sentence_of(fixture.state) == (
        "The bumper was hit. It is still pressed: move off first, then reset."
    )
    fixture.pressed = False
    fixture.tick(5)
    assert sentence_of(fixture.state) == "The bumper was hit. Reset to go on."


def test_a_release_reports_its_beginning_its_first_refusal_and_its_success() -> None:
    fixture = PolicyFixture().ready()
    assert noted(fixture, fixture.hold) == ["release_refused"]
    fixture.pressed = True
    assert noted(fixture, fixture.tick) == ["contact"]  # and another text
    assert noted(fixture, fixture.hold) == []
    fixture.linear = 0.0
    fixture.let_go(40)
    assert noted(fixture, fixture.hold) == ["release"]
    assert noted(fixture, fixture.hold) == []
    fixture.pressed = False
    assert noted(fixture, fixture.tick) == ["release_end", "release_free"]
    assert noted(fixture, fixture.hold) == []
    assert fixture.published().release_refusal == BUMPER_FREE
    fixture.let_go()
    assert noted(fixture, fixture.hold) == ["release_free"]
    before = signature(fixture.state)
    fixture.let_go()
    assert signature(fixture.state) != before


def test_a_repeated_emergency_stop_is_one_event() -> None:
    fixture = PolicyFixture().running()
    assert noted(fixture, fixture.estop) == [
        "estop"
    ]  # and not "No operator and no program is in control."
    first = fixture.latched()
    fixture.tick(30)
    assert noted(fixture, fixture.estop) == []
    assert fixture.latched() != first  # the reset must name the newest one
    fixture.linear = 0.0
    fixture.tick(30)
    assert fixture.reset() == ""
    assert noted(fixture, fixture.estop) == ["estop"]


def test_transitions_are_reported_once() -> None:
    fixture = PolicyFixture().running()
    assert noted(fixture, fixture.tick) == []
    fixture.pressed = True
    assert noted(fixture, fixture.tick) == ["contact"]  # it is the stop, and the end of control
    fixture.linear = 0.0
    assert noted(fixture, fixture.tick) == []
    fixture.left_bits = 3
    assert noted(fixture, fixture.tick) == ["driver_fault"]
    assert noted(fixture, fixture.estop) == ["estop"]
    assert noted(fixture, lambda: fixture.decide(reset=ResetRequest())) == ["reset_refused"]
    fixture.pressed, fixture.left_bits = False, 0
    fixture.tick(30)
    fixture.pressed = True
    assert noted(fixture, fixture.tick) == ["contact"]  # another press beside the first
    fixture.pressed = False
    fixture.tick(30)
    assert noted(fixture, fixture.reset) == ["reset"]
    assert noted(fixture, lambda: fixture.reset(1)) == ["reset_refused"]


def test_untrusted_sonars_are_listed() -> None:
    fixture = PolicyFixture().ready()
    assert fixture.published().doubted_sonars == ()
    fixture.sonar(front=None, rear=None)
    fixture.tick(5)
    assert fixture.published().doubted_sonars == ("front", "rear")
    assert "Sonar not trusted: front (faulty). Sonar not trusted: rear (faulty). " in sentence_of(
        fixture.state
    )
    fixture.status = ("too_near", *fixture.status[1:])
    fixture.tick(5)
    assert fixture.published().doubted_sonars == ("front", "rear")
    fixture.sonar(**dict.fromkeys(SONAR_NAMES))
    fixture.tick(5)
    assert "All sonars are faulty. " in sentence_of(fixture.state)


def test_a_change_of_source_is_reported() -> None:
    fixture = PolicyFixture().ready()
    for _ in range(15):
        assert noted(fixture, fixture.tick) == []
    assert noted(fixture, fixture.tick) == ["stop", "source"]


def test_changes_are_published_at_once_and_distances_are_not_a_change() -> None:
    fixture = PolicyFixture().running()
    fixture.sonar(front=1.0)
    fixture.drive(1.0)
    before = signature(fixture.state)
    fixture.sonar(front=0.9)
    fixture.drive(1.0)
    assert signature(fixture.state) == before
    fixture.estop()
    assert signature(fixture.state) != before
    before = signature(fixture.state)
    held = dict(fixture.state.latches)
    held["estop"] = replace(held["estop"], id=1)
    assert signature(replace(fixture.state, latches=held)) != before
    release = replace(fixture.state.release, forbidden=frozenset({"forward"}))
    assert signature(replace(fixture.state, release=release)) != before


def test_zeros_after_an_emergency_stop_are_no_control() -> None:
    fixture = PolicyFixture().ready()
    fixture.estop()
    before = fixture.state
    fixture.request(0.0)
    assert fixture.state.verdict.source == "teleop"
    assert list(transitions(before, fixture.state)) == []


def test_the_longest_state_decodes() -> None:
    names = [f"source{number:02d}{'x' * 24}" for number in range(16)]
    largest = Safety(
        sources={name: Source(priority=n, lease=0.5) for n, name in enumerate(names)},
        limits={f"l{name[1:]}": LimitSource(lease=0.5, silence="stop") for name in names},
    )
    fixture = PolicyFixture(SafetyConfig(safety=largest))
    fixture.left_bits = fixture.right_bits = 2**32 - 1
    fixture.link = replace(fixture.link, armed=False, waiting="x" * 500)
    fixture.tick()
    fixture.estop()
    for boot in (1, 2):  # two publishers of each source
        fixture.driver_boot = fixture.limit_boot = boot
        for name in names:
            fixture.request(source=name)
            fixture.limit(0.0, reason="\U000e0001" * MAX_REASON, source=f"l{name[1:]}")
    state = fixture.published()
    texts = {cause.name: cause.text for cause in state.causes}
    assert {"starting", "two_publishers", "limit_stop", "driver_left", "unarmed"} <= texts.keys()
    for name in names:
        assert f"limit l{name[1:]}" in texts["two_publishers"]
        assert f"l{name[1:]}: \\u" in texts["limit_stop"]
    assert decode(encode(state), SafetyState) == state
    everything = " ".join(texts[name] for name in state.latched)
    assert (
        len(f"Reset, but these need another reset: {everything}")
        < max(map(len, texts.values()))
        < MAX_TEXT
    )
    longer = {**largest.sources, "one_more": Source(priority=99, lease=0.5)}
    named = {"x" * 33: LimitSource(lease=0.5, silence="latch")}
    for wrong in ({"sources": longer}, {"limits": named}):
        with pytest.raises(ValidationError, match=r"length <= 16|matching regex"):
            convert(wrong, Safety)
