"""A reset on a pressed bumper: what it clears, and what stays latched."""

import pytest
from msgspec.structs import replace

from services.safety.core.causes import FaultBudget, latched
from tests.safety.policy_fixture import HOLD_TEXT, PolicyFixture, hit


def blink(fixture: PolicyFixture, field: str) -> None:
    """Report a fault of a motor driver once."""
    setattr(fixture, field, 1)
    fixture.tick()
    setattr(fixture, field, 0)


@pytest.mark.parametrize("cause", ["estop", "driver_left", "estop_reader", "flapping"])
def test_who_stands_on_the_bumper_gets_off_by_himself_whatever_else_was_latched(
    cause: str,
) -> None:
    fixture = hit()
    if cause == "estop":
        fixture.estop()
    elif cause == "driver_left":
        blink(fixture, "left_bits")
    elif cause == "estop_reader":
        fixture.estop_connection = 0
        fixture.tick()
        fixture.estop_connection = 1
    else:
        for _ in range(5):
            fixture.muted = {"velocity"}
            fixture.tick(12)
            fixture.muted = set()
            fixture.tick(30)
    fixture.tick(40)
    assert latched(fixture.state.latches) == ("contact", cause)
    assert fixture.hold() == f"{fixture.state.latches[cause].text} Reset first."
    assert fixture.reset() == "Motion is requested: release the controls first."
    fixture.let_go()
    assert fixture.reset() == ""
    assert fixture.verdict.reply is not None
    assert fixture.verdict.reply.text == f"Reset, but still latched: {HOLD_TEXT}"
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
    assert fixture.reset() == "Motion is requested: release the controls first."
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
    fault = fixture.state.latches["driver_left"].text
    assert fixture.reset() == ""
    assert fixture.verdict.reply is not None
    assert fixture.verdict.reply.text == f"Reset, but still latched: The bumper was hit. {fault}"
    assert latched(fixture.state.latches) == ("contact", "driver_left")
    fixture.tick()
    assert fixture.hold() == fault


def test_flapping_that_is_not_gone_is_not_forgiven() -> None:
    fixture = hit()
    fixture.state = replace(fixture.state, fault_budget=FaultBudget(0.0, fixture.now_ns))
    fixture.muted = {"velocity"}
    fixture.tick(12)
    fixture.muted = set()
    fixture.estop()
    fixture.tick(3)
    assert fixture.reset() == ""
    assert latched(fixture.state.latches) == ("contact", "flapping")
    assert fixture.state.fault_budget.is_spent
