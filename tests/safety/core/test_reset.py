"""Resets: conditions, answers word for word, and what stays latched."""

import copy

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from common.freshness import NS_PER_S
from services.safety.core.causes import GOOD_SAMPLES, latched
from t2.messages import CauseName, ResetRequest
from t2.words import render
from tests.factories import link
from tests.safety.core.policy_fixture import HOLD_TEXT, NO_ECHO_TEXT, PolicyFixture, hit

UNKNOWN = "Standstill is not confirmed: no velocity is received."


def test_a_trip_during_a_reset_wins() -> None:
    fixture = PolicyFixture().running()
    fixture.linear = 0.0
    fixture.estop()
    fixture.tick(20)
    fixture.pressed = True
    fixture.feed()
    assert "Still present" in fixture.reset()
    assert set(latched(fixture.state.latches)) == {"estop", "contact"}


@pytest.mark.parametrize(
    ("linear", "angular", "reason"),
    [
        (0.02, 0.0, "The vehicle still moves."),
        (0.0, -0.05, "The vehicle still moves."),
        (0.019, 0.049, ""),
    ],
)
def test_a_reset_wants_the_vehicle_to_stand(linear: float, angular: float, reason: str) -> None:
    fixture = PolicyFixture().running()
    fixture.estop()
    fixture.linear = 0.0
    fixture.tick(20)
    fixture.linear, fixture.angular = linear, angular
    fixture.tick()
    assert fixture.reset() == reason


def test_a_reset_wants_a_velocity_that_is_young() -> None:
    fixture = PolicyFixture().running()
    fixture.linear = 0.0
    fixture.estop()
    fixture.tick(20)
    fixture.muted = {"velocity"}
    fixture.now_ns += round(0.2 * NS_PER_S) + 1
    fixture.feed()
    assert fixture.reset() == UNKNOWN
    fixture.now_ns -= 1
    assert fixture.reset() == ""


def stopped() -> PolicyFixture:
    """Stop by an emergency stop, and stand."""
    fixture = PolicyFixture().running()
    fixture.estop()
    fixture.linear = 0.0
    fixture.tick(60)
    fixture.linear = None
    return fixture


def blink(fixture: PolicyFixture) -> int:
    """Report a fault of the left motor driver once; return its identity."""
    fixture.left_bits = 1
    fixture.tick()
    fixture.left_bits = 0
    fixture.tick(5)
    return fixture.state.latches["driver_left"].id


def test_a_reset_of_nothing_is_refused() -> None:
    assert PolicyFixture().ready().reset() == "Nothing needs a reset."
    fixture = stopped()
    assert fixture.reset() == ""
    fixture.tick()
    assert fixture.reset() == "Nothing needs a reset."  # a repetition


def test_a_reset_that_names_nothing_is_refused() -> None:
    fixture = stopped()
    fixture.decide(reset=ResetRequest(echo=fixture.echo))
    asked = "The reset names no cause. Send the `id` of each as `causes`. These need a reset:"
    assert (fixture.reply().done, fixture.answer()) == (False, f"{asked} Emergency stop.")
    assert latched(fixture.state.latches) == ("estop",)
    blink(fixture)
    fixture.decide(reset=ResetRequest(echo=fixture.echo))
    fault = render(fixture.state.latches["driver_left"].phrases)
    assert fixture.answer() == f"{asked} Emergency stop. {fault}"


def test_a_contact_that_is_free_and_others_stay_latched_by_their_texts() -> None:
    fixture = hit()
    fixture.pressed = False
    fixture.tick(4)
    fixture.estop()
    driver = blink(fixture)
    texts = f"The bumper was hit. {render(fixture.state.latches['estop'].phrases)}"
    assert fixture.reset(driver) == ""
    assert fixture.answer() == f"Reset, but these need another reset: {texts}"


@pytest.mark.parametrize(("ticks", "age"), [(50, ""), (51, "1.0"), (150, "3.0")])
def test_a_late_reset_is_refused(ticks: int, age: str) -> None:
    fixture = stopped()
    echo = fixture.echo
    fixture.tick(ticks)
    reason = f"The call is {age} s old, allowed is 1 s: repeat it."
    assert fixture.reset(echo=echo) == (reason if age else "")


def test_a_reset_without_a_known_echo_is_refused() -> None:
    fixture = stopped()
    fixture.decide(reset=ResetRequest(echo=None, causes=fixture.latched()))
    assert (fixture.reply().done, fixture.answer()) == (False, NO_ECHO_TEXT)
    assert "unknown state of safety" in fixture.reset(echo=2**62)
    assert latched(fixture.state.latches) == ("estop",)


def test_a_reset_clears_what_it_names_and_says_what_stays() -> None:
    fixture = stopped()
    (estop,) = fixture.latched()
    driver = blink(fixture)
    fault = render(fixture.state.latches["driver_left"].phrases)
    assert fixture.reset(estop) == ""
    assert fixture.reply().cleared == (estop,)
    assert fixture.answer() == f"Reset, but these need another reset: {fault}"
    assert latched(fixture.state.latches) == ("driver_left",)
    assert fixture.reset(estop, driver).startswith("The reset names a cause")  # half of it
    assert fixture.reset(driver) == ""
    assert fixture.reply().cleared == (driver,)
    assert fixture.answer() == "Reset. Let go of the controls, then drive."
    assert fixture.drive().command == "run"


def test_an_unnamed_contact_excuses_nothing_that_is_named() -> None:
    fixture = stopped()
    fixture.left_bits = 1
    fixture.tick(3)
    seen = fixture.latched()
    fixture.pressed = True
    fixture.tick(3)
    assert fixture.reset(*seen).startswith("Still present: The left motor driver reports")
    assert set(latched(fixture.state.latches)) == {"contact", "estop", "driver_left"}


STOPPED, LEASE_NS = stopped(), NS_PER_S * 3 // 10


class Latches(RuleBasedStateMachine):
    """Trips, looks, requests and resets in any order: a latch ends by a reset that names it."""

    def __init__(self) -> None:
        super().__init__()
        self.fixture = copy.copy(STOPPED)
        self.seen = self.fixture.latched()
        self.held: set[CauseName] = set()
        self.zero_ns = 0  # of the newest request, if it is neutral
        self.was_neutral = False  # since the last latch

    @rule(
        causes=st.sets(st.sampled_from(["estop", "driver", "contact", "reader", "link"])),
        ticks=st.integers(1, 4),
    )
    def trip(self, causes: set[str], ticks: int) -> None:
        self.fixture.pressed, self.fixture.left_bits = "contact" in causes, int("driver" in causes)
        self.fixture.estop_connection = int("reader" not in causes)
        self.fixture.link = link(state="lost" if "link" in causes else "up")
        self.fixture.estop() if "estop" in causes else self.fixture.tick()
        brakes = causes & {"estop", "contact", "reader"}
        if causes:
            assert self.fixture.verdict.command != "run"
        assert not brakes or self.fixture.verdict.command == "brake"
        self.fixture.tick(ticks)
        self.fixture.pressed, self.fixture.left_bits = False, 0
        self.fixture.estop_connection, self.fixture.link = 1, link()

    @rule()
    def look(self) -> None:
        self.seen = self.fixture.latched()

    @rule(linear=st.sampled_from([None, 0.0, 0.3]), ticks=st.integers(1, 20))
    def wait(self, linear: float | None, ticks: int) -> None:
        for _ in range(ticks):
            self.fixture.tick()
            is_zero = linear == 0.0 or self.fixture.now_ns - self.zero_ns <= LEASE_NS
            self.was_neutral |= is_zero and not self.held
            if linear is not None:
                self.fixture.request(linear)
                self.zero_ns = 0 if linear else self.fixture.now_ns
            assert self.was_neutral or self.fixture.verdict.twist.is_zero

    @rule(name=st.sampled_from(["all", "seen", "first"]))
    def reset(self, name: str) -> None:
        before = {one.id: one for one in map(self.fixture.state.latches.__getitem__, self.held)}
        ids = self.seen if name == "seen" else self.fixture.latched()[: 1 if name == "first" else 9]
        reply = self.fixture.decide(reset=ResetRequest(echo=self.fixture.echo, causes=ids)).reply
        assert reply
        gone = before.keys() - set(self.fixture.latched())
        assert gone == set(reply.cleared)
        assert gone <= set(ids)
        assert all(before[one].good >= GOOD_SAMPLES for one in gone)
        self.held = set(latched(self.fixture.state.latches))

    @invariant()
    def what_is_latched_stays_and_stops(self) -> None:
        now = set(latched(self.fixture.state.latches))
        assert self.held <= now
        assert not now or self.fixture.verdict.twist.is_zero
        self.held, self.was_neutral = now, self.was_neutral and not now


TestLatches = Latches.TestCase
TestLatches.settings = settings(max_examples=30, stateful_step_count=30, deadline=None)


def test_at_a_pressed_bumper_a_reset_clears_the_others_and_a_release_comes_next() -> None:
    fixture = hit()
    blink(fixture)
    fixture.tick(40)
    assert latched(fixture.state.latches) == ("contact", "driver_left")
    assert fixture.hold() == f"{render(fixture.state.latches['driver_left'].phrases)} Reset first."
    assert fixture.reset() == "A command to drive is given: let go of the controls first."
    fixture.let_go()
    assert fixture.reset() == ""
    assert fixture.answer() == f"Reset, but these need another reset: {HOLD_TEXT}"
    assert latched(fixture.state.latches) == ("contact",)
    assert fixture.drive(0.5).command == "brake"
    assert fixture.drive(0.0).command == "brake"
    assert fixture.hold("backward", 2) == ""
    assert fixture.verdict.twist.linear < 0
    fixture.pressed = False
    fixture.let_go(10)
    assert fixture.reset() == ""
    assert fixture.drive().command == "run"


def test_a_reset_on_a_pressed_bumper_wants_all_that_a_reset_wants() -> None:
    fixture = hit()
    assert fixture.reset() == f"Still present: {HOLD_TEXT}"
    fixture.estop()
    assert "Still present: The bumper was hit. Emergency stop." in fixture.reset()
    fixture.tick(3)
    fixture.linear = 0.3
    fixture.tick()
    assert fixture.reset() == "The vehicle still moves."
    fixture.linear = None
    fixture.tick()
    fixture.request(0.5)
    assert fixture.reset() == "A command to drive is given: let go of the controls first."
    fixture.tick(40)
    fixture.pressed = False
    fixture.tick()
    assert fixture.reset() == "Still present: The bumper was hit."
    assert latched(fixture.state.latches) == ("contact", "estop")


def test_a_reset_on_a_pressed_bumper_leaves_what_is_not_gone() -> None:
    fixture = hit()
    fixture.estop()
    fixture.left_bits = 1
    fixture.tick(3)
    fault = render(fixture.state.latches["driver_left"].phrases)
    assert fixture.reset() == ""
    assert fixture.answer() == f"Reset, but these need another reset: The bumper was hit. {fault}"
    assert latched(fixture.state.latches) == ("contact", "driver_left")
    fixture.tick()
    assert fixture.hold() == fault
