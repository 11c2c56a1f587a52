"""The answers to an operator's calls, word for word, and what a call changes."""

import pytest
from msgspec.structs import replace

from common.freshness import NS_PER_S
from services.safety import operator_requests
from services.safety.config import Safety
from services.safety.fault_budget import FaultBudget
from services.safety.inputs import Event, Hold, Inputs, Reset
from services.safety.latches import Held, latched
from services.safety.release import Release
from services.safety.state import Reply, State
from tests.safety.policy_fixture import Scene, hit

SETTINGS = Safety()
BY_HAND = "Push the vehicle off by hand, then reset."


def inputs_of(scene: Scene, event: Event | None = None) -> Inputs:
    return replace(scene.inputs, reader=True, event=event)


def called(scene: Scene, event: Event) -> tuple[State, Reply]:
    """Answer a call right now, without the rest of the decision."""
    state, reply = operator_requests.answer(
        scene.state, inputs_of(scene, event), SETTINGS, scene.now_ns
    )
    assert reply is not None
    return state, reply


def with_release(scene: Scene, **fields: object) -> Scene:
    """Change what is remembered of the release."""
    release: Release = replace(scene.state.release, **fields)
    scene.state = replace(scene.state, release=release)
    return scene


def also(scene: Scene, name: str, text: str, *, good: int = 9) -> int:
    """Latch another cause, gone already unless ``good`` is small; return its identity."""
    one = Held(scene.now_ns - NS_PER_S, scene.now_ns - NS_PER_S, good, (0, 1), text, id=len(name))
    scene.state = replace(scene.state, latches={**scene.state.latches, name: one})
    return one.id


def freed() -> Scene:
    """Return a contact whose bumper is free again."""
    scene = hit()
    scene.pressed = False
    scene.tick(5)
    return scene


# --- letting go ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("older", "let_go"), [(3, -3), (0, 0), (-5, 0), (None, 0)])
def test_letting_go_ends_calls_up_to_its_echo(older: int | None, let_go: int) -> None:
    scene = hit()
    newest = scene.state.heartbeat.number
    echo = None if older is None else newest - older
    state, reply = called(scene, Hold(False, None, echo))
    assert reply == Reply(True, "Let go.")
    assert (state.release.let_go, state.release.held_ns) == (newest + let_go, None)


# --- holding ------------------------------------------------------------------------------------


def test_a_hold_says_how_far_it_may_move() -> None:
    scene = hit()
    state, reply = called(scene, Hold(True, "backward", scene.echo))
    left = operator_requests.room(state, SETTINGS)
    assert 0 < left < SETTINGS.release_distance
    assert reply == Reply(True, f"Moving backward off the bumper, {left:.2f} m left.")
    assert (state.release.direction, state.release.held_ns) == ("backward", scene.now_ns)


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
    scene = with_release(hit(), held_ns=1, **fields)
    state, reply = called(scene, Hold(True, "backward", scene.echo))
    assert reply == Reply(False, f"{text} {BY_HAND}")
    assert state.release.held_ns is None


def test_the_distance_is_used_up_at_nothing_left() -> None:
    scene = hit()
    whole = operator_requests.room(scene.state, SETTINGS)
    for used, done in ((whole - 1e-6, True), (whole, False)):
        moved = with_release(hit(), integrated=used)
        assert called(moved, Hold(True, "backward", moved.echo))[1].done is done


def test_a_held_release_without_its_contact_does_not_creep() -> None:
    scene = with_release(hit(), held_ns=hit().now_ns, direction="backward")
    assert operator_requests.is_creeping(scene.state, inputs_of(scene), SETTINGS, scene.now_ns)
    scene.state = replace(scene.state, latches={})
    assert not operator_requests.is_creeping(scene.state, inputs_of(scene), SETTINGS, scene.now_ns)


def test_a_held_release_in_a_forbidden_direction_does_not_creep() -> None:
    fields = {"direction": "backward", "forbidden": frozenset(("backward",))}
    scene = with_release(hit(), held_ns=hit().now_ns, **fields)
    assert not operator_requests.is_creeping(scene.state, inputs_of(scene), SETTINGS, scene.now_ns)


# --- resetting ----------------------------------------------------------------------------------


def test_a_reset_earns_the_credit_back_unless_flapping_stays() -> None:
    for stays, credit in ((False, FaultBudget()), (True, FaultBudget(0.5, 7))):
        scene = freed()
        (contact,) = (scene.state.latches[name].id for name in latched(scene.state.latches))
        scene.state = replace(scene.state, credit=FaultBudget(0.5, 7))
        if stays:
            also(scene, "flapping", "Inputs failed.")
        state, reply = called(scene, Reset(scene.echo, (contact,)))
        assert reply.done
        assert state.credit == credit


def test_what_stays_latched_is_named() -> None:
    scene = freed()
    ids = [also(scene, "estop", "One."), also(scene, "runaway", "Two.")]
    contact = scene.state.latches["contact"].id
    assert called(scene, Reset(scene.echo, (contact,)))[1].text == "Reset all but this: One. Two."
    assert called(scene, Reset(scene.echo, tuple(ids)))[1].text == (
        "Reset all but this: The bumper was hit."
    ), "it is free: no advice how to move off"
    assert called(scene, Reset(scene.echo, ()))[1].text == (
        "The reset names no cause. Latched: The bumper was hit. One. Two. "
        "Send the `id` of each as `causes`."
    )


def test_a_bumper_that_is_pressed_without_a_latch_is_no_remaining_contact() -> None:
    scene = hit()
    latches = {name: one for name, one in scene.state.latches.items() if name != "contact"}
    scene.state = replace(scene.state, latches=latches)
    estop, _ = also(scene, "estop", "One."), also(scene, "runaway", "Two.")
    _, reply = called(scene, Reset(scene.echo, (estop,)))
    assert (reply.done, reply.text) == (True, "Reset all but this: Two.")
