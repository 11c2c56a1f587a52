"""Direction and distance of a release: what is known, forbidden and left."""

import math

import pytest

from common.freshness import NS_PER_S
from common.messages import Direction, Mileage
from services.safety.causes import BY_NAME
from tests.safety.policy_fixture import (
    CHOOSE_TEXT,
    DIRECTIONS,
    HOLD_TEXT,
    USED_UP_TEXT,
    PolicyFixture,
    hit,
)

BOTH = "The bumper was pressed in both directions. Push the vehicle off by hand, then reset."


def forbidden(direction: str) -> str:
    return f"Release {direction} is forbidden until a reset: the bumper was pressed that way."


def test_a_rebound_before_the_bumper_does_not_choose_the_direction() -> None:
    fixture = PolicyFixture().running()
    fixture.linear = -0.05
    fixture.tick(2)
    fixture.pressed = True
    fixture.tick()
    fixture.linear = 0.0
    fixture.tick(40)
    fixture.linear = None
    release = fixture.published().release
    assert release is not None
    assert release.believed_free == "backward"
    assert release.travelled == pytest.approx(0.75, abs=0.03)
    assert release.age == pytest.approx(0.86, abs=0.05)
    fixture.hold()
    assert fixture.tick(10).twist.linear < 0


def test_pressed_again_while_it_moves_off_it_goes_no_farther_that_way() -> None:
    fixture, runs = hit(), 0
    for _ in range(30):
        fixture.tick()
        assert fixture.hold() == ""
    fixture.pressed = False
    fixture.tick(5)
    fixture.pressed = True
    for _ in range(300):
        runs += fixture.tick().command == "run"
        assert fixture.hold() == forbidden("backward")
    assert runs == 0
    release = fixture.published().release
    assert release is not None
    assert (release.believed_free, release.forbidden) == (None, ("backward",))
    left = release.left
    assert fixture.hold(direction="forward") == ""
    assert fixture.tick(5).twist.linear > 0
    release = fixture.published().release
    assert release is not None
    assert 0 < release.left < left < 0.1
    fixture.pressed = False
    fixture.tick()
    fixture.pressed = True
    fixture.tick(40)
    for either in DIRECTIONS:
        assert fixture.hold(direction=either) == BOTH
    assert fixture.reset() == f"Still present: {BY_NAME['contact'].text} {BOTH}"


def press_again(fixture: PolicyFixture, direction: Direction) -> None:
    """Hold the release in this direction, and free the bumper for one tick."""
    for _ in range(10):
        fixture.tick()
        fixture.hold(direction=direction)
    fixture.pressed = False
    fixture.tick()
    fixture.pressed = True
    fixture.tick(40)


@pytest.mark.parametrize(
    ("pressed_again", "advice"),
    [
        (
            "backward",
            "Hold release forward to move off. The vehicle drove forward into the contact: "
            "check that direction first.",
        ),
        ("forward", "Hold release backward to move off."),
    ],
)
def test_the_advice_names_only_the_direction_that_is_left(
    pressed_again: Direction, advice: str
) -> None:
    fixture = hit()
    press_again(fixture, pressed_again)
    assert fixture.reset() == f"Still present: The bumper was hit. {advice}"


def test_the_direction_that_moved_is_forbidden_not_the_one_held_next() -> None:
    fixture = hit()
    for _ in range(10):
        fixture.tick()
        fixture.hold()
    fixture.hold(held=False)
    fixture.tick(2)
    assert fixture.hold(direction="forward") == ""
    fixture.pressed = False  # before anything moves forward
    fixture.decide()
    fixture.tick()
    fixture.pressed = True
    fixture.tick(2)
    assert fixture.state.release.forbidden == {"backward"}


def test_a_reset_and_a_new_contact_have_the_way_anew() -> None:
    fixture = hit()
    for _ in range(30):
        fixture.tick()
        fixture.hold()
    fixture.pressed = False
    fixture.tick()
    fixture.pressed = True
    fixture.tick(40)
    assert fixture.hold() == forbidden("backward")
    fixture.pressed = False
    fixture.tick(10)
    assert fixture.published().release is not None
    assert fixture.reset() == ""
    assert fixture.published().release is None
    fixture.pressed = True
    fixture.tick()
    release = fixture.published().release
    assert release is not None
    assert release.forbidden == ()
    assert release.left == pytest.approx(0.15 - 0.025 - 0.1**2 / 1.2)
    assert fixture.hold() == ""


def test_a_contact_after_an_hour_reports_the_age_and_nothing_moves_by_itself() -> None:
    fixture = PolicyFixture().running()
    fixture.drive(0.0, seconds=2)
    fixture.now_ns += 3600 * NS_PER_S
    fixture.tick(60)
    assert fixture.reset() == ""  # an emergency stop may have been missed
    fixture.pressed = True
    fixture.tick(40)
    release = fixture.published().release
    assert release is not None
    assert release.believed_free == "backward"
    assert release.age is not None
    assert release.age > 3600
    assert fixture.hold(direction=None) == CHOOSE_TEXT
    assert fixture.tick(10).command == "brake"
    assert fixture.hold(direction="forward") == ""
    assert fixture.tick(10).twist.linear > 0


def test_the_counters_end_the_way_when_wheels_slip() -> None:
    fixture = hit()
    began = fixture.distance
    while not fixture.hold():
        fixture.tick()
        fixture.distance -= 0.006  # three times the reported velocity
    assert fixture.hold() == USED_UP_TEXT
    assert 0.1 < began - fixture.distance < 0.15


def test_a_new_press_has_no_way_anew() -> None:
    fixture = hit()
    while not fixture.hold():
        fixture.tick()
    fixture.tick(40)
    for clear in (2, 10):
        fixture.pressed = False
        fixture.tick(clear)
        fixture.pressed = True
        fixture.tick(40)
        for either in DIRECTIONS:
            assert fixture.hold(direction=either) == USED_UP_TEXT


def test_a_press_long_after_a_release_forbids_nothing() -> None:
    fixture = hit()
    fixture.hold()
    fixture.tick(10)
    fixture.pressed = False
    fixture.tick(60)
    fixture.pressed = True
    fixture.tick()
    assert fixture.hold() == ""
    assert fixture.tick(5).command == "run"


def test_pressed_from_the_start_no_way_is_believed_free_and_either_may_be_chosen() -> None:
    fixture = PolicyFixture()
    fixture.pressed = True
    fixture.tick(50)
    release = fixture.published().release
    assert release is not None
    assert (release.believed_free, release.travelled, release.age) == (None, 0.0, None)
    assert fixture.reset() == f"Still present: {HOLD_TEXT}"
    assert fixture.hold(direction="forward") == ""
    assert fixture.tick(5).twist.linear > 0
    fixture.pressed = False
    fixture.tick(40)
    assert fixture.reset() == ""
    assert fixture.drive().command == "run"


def test_a_second_contact_looks_at_the_travel_between() -> None:
    fixture = hit()
    for _ in range(20):
        fixture.tick()
        fixture.hold()
    fixture.pressed = False
    fixture.tick(10)
    fixture.linear = -0.5  # pushed by hand
    fixture.tick(100)
    fixture.linear = None
    fixture.pressed = True
    fixture.tick(2)
    release = fixture.published().release
    assert release is not None
    assert release.believed_free == "forward"
    assert release.travelled == pytest.approx(-1.0)


@pytest.mark.parametrize("distance", [math.nan, math.inf])
def test_counters_that_are_no_numbers_stop_no_release_and_free_no_way(distance: float) -> None:
    fixture = hit()
    fixture.distance = distance
    fixture.muted = {"mileage"}
    fixture.put("mileage", Mileage(distance=distance, heading=0.0, epoch=0))
    while not fixture.hold():
        fixture.tick()
    assert fixture.hold() == USED_UP_TEXT
    release = fixture.published().release
    assert release is not None
    assert release.believed_free == "backward"
    assert math.isfinite(release.travelled)
