"""The answers to an operator's calls, word for word, and what a call changes."""

import pytest
from msgspec.structs import replace

from common.freshness import NS_PER_S
from services.safety import operator_requests
from services.safety.config import Safety
from services.safety.inputs import Event, Hold, Inputs, Reset
from services.safety.latches import FaultBudget, Held, latched
from services.safety.release import Release
from services.safety.state import Reply, State
from tests.safety.policy_fixture import PolicyFixture, hit

SETTINGS = Safety()
BY_HAND = "Push the vehicle off by hand, then reset."


def inputs_of(fixture: PolicyFixture, event: Event | None = None) -> Inputs:
    return replace(fixture.inputs, estop_connection=1, event=event)


def creeps(fixture: PolicyFixture) -> bool:
    now_ns = fixture.now_ns
    return operator_requests.is_creeping(fixture.state, inputs_of(fixture), SETTINGS, now_ns)


def called(fixture: PolicyFixture, event: Event) -> tuple[State, Reply]:
    """Answer a call right now, without the rest of the decision."""
    state, reply = operator_requests.handle(
        fixture.state, inputs_of(fixture, event), SETTINGS, fixture.now_ns
    )
    assert reply is not None
    return state, reply


def with_release(fixture: PolicyFixture, **fields: object) -> PolicyFixture:
    """Change what is remembered of the release."""
    release: Release = replace(fixture.state.release, **fields)
    fixture.state = replace(fixture.state, release=release)
    return fixture


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


# --- letting go ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("older", "ended_echo"), [(3, -3), (0, 0), (-5, 0), (None, 0)])
def test_letting_go_ends_calls_up_to_its_echo(older: int | None, ended_echo: int) -> None:
    fixture = hit()
    newest = fixture.state.heartbeat.number
    echo = None if older is None else newest - older
    state, reply = called(fixture, Hold(False, None, echo))
    assert reply == Reply(True, "Release ended.")
    assert (state.release.ended_echo, state.release.held_ns) == (newest + ended_echo, None)


# --- holding ------------------------------------------------------------------------------------


def test_a_hold_says_how_far_it_may_move() -> None:
    fixture = hit()
    state, reply = called(fixture, Hold(True, "backward", fixture.echo))
    left = operator_requests.room(state, SETTINGS)
    assert 0 < left < SETTINGS.release_distance
    assert reply == Reply(True, f"Moving backward off the bumper, {left:.2f} m left.")
    assert (state.release.direction, state.release.held_ns) == ("backward", fixture.now_ns)


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"unknown": True}, "Safety has restarted: the travel of an earlier release is unknown."),
        (
            {"forbidden": frozenset(("forward", "backward"))},
            "The bumper was pressed in both directions.",
        ),
        ({"integrated": 9.0}, "The distance for moving off is used up."),
    ],
)
def test_a_release_that_is_spent_says_why(fields: dict[str, object], text: str) -> None:
    fixture = with_release(hit(), held_ns=1, **fields)
    state, reply = called(fixture, Hold(True, "backward", fixture.echo))
    assert reply == Reply(False, f"{text} {BY_HAND}")
    assert state.release.held_ns is None


def test_the_distance_is_used_up_at_nothing_left() -> None:
    fixture = hit()
    whole = operator_requests.room(fixture.state, SETTINGS)
    for used, done in ((whole - 1e-6, True), (whole, False)):
        moved = with_release(hit(), integrated=used)
        assert called(moved, Hold(True, "backward", moved.echo))[1].done is done


def test_a_held_release_without_its_contact_does_not_creep() -> None:
    fixture = with_release(hit(), held_ns=hit().now_ns, direction="backward")
    assert operator_requests.is_creeping(
        fixture.state, inputs_of(fixture), SETTINGS, fixture.now_ns
    )
    fixture.state = replace(fixture.state, latches={})
    assert not operator_requests.is_creeping(
        fixture.state, inputs_of(fixture), SETTINGS, fixture.now_ns
    )


def test_a_held_release_in_a_forbidden_direction_does_not_creep() -> None:
    fields = {"direction": "backward", "forbidden": frozenset(("backward",))}
    fixture = with_release(hit(), held_ns=hit().now_ns, **fields)
    assert not operator_requests.is_creeping(
        fixture.state, inputs_of(fixture), SETTINGS, fixture.now_ns
    )


# --- resetting ----------------------------------------------------------------------------------


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


def test_a_held_release_does_not_creep_once_the_bumper_is_free() -> None:
    fixture = freed()
    with_release(fixture, direction="backward", held_ns=fixture.now_ns)
    assert not creeps(fixture)
