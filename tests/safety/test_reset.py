"""What a reset wants besides that the causes are gone."""

import copy
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.freshness import NS_PER_S
from services.safety.inputs import Reset
from services.safety.latches import latched
from services.safety.state import Reply
from tests.safety.policy_fixture import NO_ECHO_TEXT, Scene, hit

UNKNOWN = "It is not known whether the vehicle stands: its velocity is not heard."


def test_a_trip_during_a_reset_wins() -> None:
    scene = Scene().running()
    scene.linear = 0.0
    scene.estop()
    scene.tick(20)
    scene.pressed = True
    scene.feed()
    assert "Not gone yet" in scene.reset()
    assert set(latched(scene.state.latches)) == {"estop", "contact"}


@pytest.mark.parametrize(
    ("linear", "angular", "reason"),
    [
        (0.02, 0.0, "The vehicle still moves."),
        (0.0, -0.05, "The vehicle still moves."),
        (math.nan, 0.0, UNKNOWN),
        (0.019, 0.049, ""),
    ],
)
def test_a_reset_wants_the_vehicle_to_stand(linear: float, angular: float, reason: str) -> None:
    scene = Scene().running()
    scene.estop()
    scene.linear = 0.0
    scene.tick(20)
    scene.linear, scene.angular = linear, angular
    scene.tick()
    assert scene.reset() == reason


def test_a_reset_wants_a_velocity_that_is_young() -> None:
    scene = Scene().running()
    scene.linear = 0.0
    scene.estop()
    scene.tick(20)
    scene.muted = {"velocity"}
    scene.now_ns += round(0.2 * NS_PER_S) + 1
    scene.feed()
    assert scene.reset() == UNKNOWN
    scene.now_ns -= 1
    assert scene.reset() == ""


def stopped() -> Scene:
    """Stop by an emergency stop, and stand."""
    scene = Scene().running()
    scene.estop()
    scene.linear = 0.0
    scene.tick(60)
    scene.linear = None
    return scene


def blink(scene: Scene) -> int:
    """Let a motor driver report a fault once; return its identity."""
    scene.left_bits = 1
    scene.tick()
    scene.left_bits = 0
    scene.tick(5)
    return scene.state.latches["driver_left"].id


def answer(scene: Scene) -> Reply:
    assert scene.verdict.reply is not None
    return scene.verdict.reply


def test_a_reset_of_nothing_is_refused() -> None:
    assert Scene().ready().reset() == "Nothing is latched."
    scene = stopped()
    assert scene.reset() == ""
    scene.tick()
    assert scene.reset() == "Nothing is latched."  # a repetition


def test_a_reset_that_names_nothing_is_refused() -> None:
    scene = stopped()
    refused = scene.decide(Reset(scene.echo)).reply
    assert refused == Reply(
        False,
        "The reset names no cause. Latched: Emergency stop. Send the `id` of each as `causes`.",
    )
    assert latched(scene.state.latches) == ("estop",)


@pytest.mark.parametrize(("ticks", "age"), [(50, ""), (51, "1.0"), (150, "3.0")])
def test_a_late_reset_is_refused(ticks: int, age: str) -> None:
    scene = stopped()
    echo = scene.echo
    scene.tick(ticks)
    reason = f"The call is {age} s old, allowed is 1 s: repeat it."
    assert scene.reset(echo=echo) == (reason if age else "")


def test_a_reset_without_a_known_echo_is_refused() -> None:
    scene = stopped()
    assert scene.decide(Reset(None, scene.latched())).reply == Reply(False, NO_ECHO_TEXT)
    assert "unknown heartbeat" in scene.reset(echo=2**62)
    assert latched(scene.state.latches) == ("estop",)


def test_a_reset_that_was_held_back_does_not_clear_a_newer_contact() -> None:
    scene = hit()
    scene.pressed = False
    scene.tick(10)
    echo, seen = scene.echo, scene.latched()
    assert scene.reset() == ""
    scene.drive()
    scene.drive(0.3, seconds=0.5)
    scene.pressed = True
    scene.tick()
    scene.linear = 0.0
    scene.tick(40)
    scene.pressed = False
    scene.tick(10)
    assert scene.latched() != seen
    assert "allowed is 1 s" in scene.reset(*seen, echo=echo)
    assert "not latched any more" in scene.reset(*seen)  # even if it were in time
    assert latched(scene.state.latches) == ("contact",)
    assert scene.drive(0.3, seconds=1.0).command == "brake"


def test_a_contact_that_came_back_is_not_the_one_that_was_seen() -> None:
    scene = hit()
    scene.pressed = False
    scene.tick(10)
    seen = scene.latched()
    scene.pressed = True
    scene.tick()
    scene.pressed = False
    scene.tick(10)
    assert scene.reset(*seen) == (
        "A cause that the reset names is not latched any more. Now latched: The bumper was hit."
    )
    assert scene.reset() == ""


def test_a_reset_clears_what_it_names_and_says_what_stays() -> None:
    scene = stopped()
    (estop,) = scene.latched()
    driver = blink(scene)
    fault = scene.state.latches["driver_left"].text
    assert scene.reset(estop) == ""
    assert answer(scene) == Reply(True, f"Reset all but this: {fault}", (estop,))
    assert latched(scene.state.latches) == ("driver_left",)
    assert scene.reset(estop, driver).startswith("A cause that the reset names")  # half of it
    assert scene.reset(driver) == ""
    assert answer(scene) == Reply(
        True, "Reset: a neutral request is due before the vehicle moves.", (driver,)
    )
    assert scene.drive().command == "run"


def test_an_unnamed_cause_that_is_there_stops_no_reset_of_another() -> None:
    scene = stopped()
    (estop,) = scene.latched()
    scene.pressed = True
    scene.tick(3)
    assert scene.reset(estop) == ""
    assert "The bumper was hit. Hold release" in answer(scene).text
    assert answer(scene).cleared == (estop,)
    assert latched(scene.state.latches) == ("contact",)


def test_an_unnamed_contact_excuses_nothing_that_is_named() -> None:
    scene = stopped()
    scene.left_bits = 1
    scene.tick(3)
    seen = scene.latched()
    scene.pressed = True
    scene.tick(3)
    assert scene.reset(*seen).startswith("Not gone yet: The left motor driver reports")
    assert set(latched(scene.state.latches)) == {"contact", "estop", "driver_left"}


def test_a_cleared_cause_that_comes_back_has_a_new_identity() -> None:
    scene = stopped()
    seen = scene.latched()
    assert scene.reset() == ""
    scene.estop()
    scene.tick(5)
    assert scene.latched() != seen
    assert "not latched any more" in scene.reset(*seen)
    assert latched(scene.state.latches) == ("estop",)


STOPPED = stopped()


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.sampled_from(["estop", "driver", "contact", "reset", "stale", "wait"]), max_size=12)
)
def test_nothing_is_ever_cleared_that_was_not_named(acts: list[str]) -> None:
    scene = copy.copy(STOPPED)
    seen = scene.latched()
    for act in acts:
        before = set(scene.latched())
        named: tuple[int, ...] = ()
        if act == "estop":
            scene.estop()
        elif act == "driver":
            blink(scene)
        elif act == "contact":
            scene.pressed = True
            scene.tick(2)
            scene.pressed = False
            scene.tick(4)
        elif act == "wait":
            seen = scene.latched()
            scene.tick(5)
        elif act == "reset":
            named = scene.latched()
            scene.reset()
        else:
            named = seen
            scene.decide(Reset(scene.echo, seen))
        gone = {one for one in before - set(scene.latched()) if not _renewed(act)}
        assert gone <= set(named)


def _renewed(act: str) -> bool:
    """A cause that comes back has a new identity: the older occurrence is not reported."""
    return act in ("estop", "driver", "contact")
