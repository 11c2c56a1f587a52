"""The answers to a reset, word for word, and what it changes."""

from msgspec.structs import replace

from common.freshness import NS_PER_S
from services.safety.config import Safety
from services.safety.core import operator_requests
from services.safety.core.causes import FaultBudget, Held, latched
from services.safety.core.inputs import Event, Inputs, Reset
from services.safety.core.state import Reply, State
from tests.safety.policy_fixture import PolicyFixture, hit

SETTINGS = Safety()


def inputs_of(fixture: PolicyFixture, event: Event | None = None) -> Inputs:
    return replace(fixture.inputs, estop_connection=1, event=event)


def called(fixture: PolicyFixture, event: Event) -> tuple[State, Reply]:
    """Answer a call right now, without the rest of the decision."""
    state, reply = operator_requests.handle(
        fixture.state, inputs_of(fixture, event), SETTINGS, fixture.now_ns
    )
    assert reply is not None
    return state, reply


def also(fixture: PolicyFixture, name: str, text: str, *, good: int = 9) -> int:
    """Latch another cause, gone already unless ``good`` is small; return its identity."""
    one = Held(
        fixture.now_ns - NS_PER_S, fixture.now_ns - NS_PER_S, good, (0, 1), text, id=len(name)
    )
    fixture.state = replace(fixture.state, latches={**fixture.state.latches, name: one})
    return one.id


def freed() -> PolicyFixture:
    """Return a contact whose bumper is free again."""
    fixture = hit()
    fixture.pressed = False
    fixture.tick(5)
    return fixture


def test_a_reset_earns_the_credit_back_unless_flapping_stays() -> None:
    for stays, budget in ((False, FaultBudget()), (True, FaultBudget(0.5, 7))):
        fixture = freed()
        (contact,) = (fixture.state.latches[name].id for name in latched(fixture.state.latches))
        fixture.state = replace(fixture.state, fault_budget=FaultBudget(0.5, 7))
        if stays:
            also(fixture, "flapping", "Inputs failed.")
        state, reply = called(fixture, Reset(fixture.echo, (contact,)))
        assert reply.done
        assert state.fault_budget == budget


def test_what_stays_latched_is_named() -> None:
    fixture = freed()
    ids = [also(fixture, "estop", "One."), also(fixture, "runaway", "Two.")]
    contact = fixture.state.latches["contact"].id
    assert (
        called(fixture, Reset(fixture.echo, (contact,)))[1].text
        == "Reset, but still latched: One. Two."
    )
    assert called(fixture, Reset(fixture.echo, tuple(ids)))[1].text == (
        "Reset, but still latched: The bumper was hit."
    ), "it is free: no advice how to move off"
    assert called(fixture, Reset(fixture.echo, ()))[1].text == (
        "The reset names no cause. Latched: The bumper was hit. One. Two. "
        "Send the `id` of each as `causes`."
    )


def test_a_bumper_that_is_pressed_without_a_latch_is_no_remaining_contact() -> None:
    fixture = hit()
    latches = {name: one for name, one in fixture.state.latches.items() if name != "contact"}
    fixture.state = replace(fixture.state, latches=latches)
    estop, _ = also(fixture, "estop", "One."), also(fixture, "runaway", "Two.")
    _, reply = called(fixture, Reset(fixture.echo, (estop,)))
    assert (reply.done, reply.text) == (True, "Reset, but still latched: Two.")
