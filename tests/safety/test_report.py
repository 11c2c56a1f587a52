"""What is told: sentences, causes, limits, and events on transitions only."""

import pytest
from msgspec.structs import replace

from common.messages import Direction, Drive
from services.safety.inputs import Ask, Estop, Event, Hold, Reset
from services.safety.report import (
    motion_message,
    notes,
    sentence,
    signature,
    state_message,
    timed,
)
from tests.safety.policy_fixture import Scene, hit


def noted(scene: Scene, event: Event | None = None) -> list[str]:
    before = scene.state
    scene.decide(event)
    return [note.name for note in notes(before, scene.state, event)]


def ticked(scene: Scene) -> list[str]:
    before = scene.state
    scene.tick()
    return [note.name for note in notes(before, scene.state, None)]


def test_the_state_tells_verdict_causes_and_limits() -> None:
    scene = Scene().running()
    scene.sonar(front=1.0)
    scene.linear = 0.0
    scene.drive(1.0)
    state = state_message(scene.policy, scene.state, scene.now_ns + 500_000_000)
    assert (state.verdict, state.source, state.latched) == ("slow", "teleop", ())
    assert [cause.name for cause in state.causes] == ["obstacle"]
    assert state.causes[0].age >= 0.5
    assert state.limits.forward == pytest.approx(scene.policy.planner.zones.allowed(1.0))
    assert (state.limits.backward, state.limits.angular) == (1.0, 1.0)
    assert state.heartbeat == scene.state.heartbeat.number


def test_the_motion_tells_what_was_judged() -> None:
    scene = Scene().running()
    motion = motion_message(scene.state, scene.inputs)
    assert (motion.command, motion.source) == ("run", "teleop")
    assert motion.linear == pytest.approx(scene.verdict.twist.linear)
    assert (motion.judged_boot, motion.judged) == (scene.boot, scene.seq)


REQUEST = Drive(linear=0.1, angular=0.0, echo=0, mono_ns=40)


def timed_by(scene: Scene, ask: Ask) -> tuple[int, int, int]:
    inputs = replace(scene.inputs, event=ask)
    motion = timed(motion_message(scene.state, scene.inputs), scene.state, inputs)
    assert (motion.command, motion.judged) == ("run", scene.seq)  # what was there stays
    return motion.asked_ns, motion.heard_ns, motion.judged_ns


def test_the_motion_carries_the_times_of_what_it_answers() -> None:
    scene = Scene().running()
    judged_ns = scene.now_ns
    assert timed_by(scene, Ask("teleop", REQUEST, 50, True)) == (40, 50, judged_ns)
    assert timed_by(scene, Ask("teleop", REQUEST, 50, False)) == (0, 50, judged_ns)


def test_only_a_request_that_drives_is_answered() -> None:
    scene = Scene().running()
    assert timed_by(scene, Ask("web", REQUEST, 50, True))[:2] == (0, 0)
    assert timed_by(scene, Ask("teleop", None, 50, True))[:2] == (0, 0)
    scene.state = replace(scene.state, verdict=replace(scene.verdict, refused="late"))
    assert timed_by(scene, Ask("teleop", REQUEST, 50, True))[:2] == (0, 0)


def test_a_motion_that_answers_nothing_carries_no_times() -> None:
    scene = Scene()
    motion = timed(
        motion_message(scene.state, scene.inputs), scene.state, replace(scene.inputs, event=Reset())
    )
    assert (motion.asked_ns, motion.heard_ns, motion.judged_ns) == (0, 0, 0)


def test_one_sentence_says_why() -> None:
    scene = Scene()
    assert sentence(scene.state).startswith("Waiting for the first sample of: velocity,")
    scene.tick(40)
    assert sentence(scene.state) == "Nobody asks to move."
    scene.drive(0.5)
    assert sentence(scene.state).startswith("Waiting for a neutral request")
    scene.drive()
    assert sentence(scene.state) == "Driving as teleop asks."
    scene.sonar(front=0.5)
    scene.drive(0.5)
    assert (
        sentence(scene.state) == "Slowed by an obstacle at 0.50 m (front). Driving as teleop asks."
    )
    scene.pressed = True
    scene.tick()
    assert sentence(scene.state) == "The bumper was hit. It is not gone yet."
    scene.pressed = False
    scene.tick(5)
    assert sentence(scene.state) == "The bumper was hit. Reset to go on."


def test_transitions_are_told_once() -> None:
    scene = Scene().running()
    assert ticked(scene) == []
    scene.pressed = True
    assert ticked(scene) == ["contact", "stop"]
    scene.linear = 0.0
    assert ticked(scene) == []
    scene.left_bits = 3
    assert ticked(scene) == ["driver_fault"]
    assert noted(scene, Estop()) == ["estop"]
    assert noted(scene, Reset()) == ["reset_refused"]
    assert noted(scene, Hold(True)) == ["release_refused"]
    scene.pressed, scene.left_bits = False, 0
    scene.tick(30)
    scene.pressed = True
    assert ticked(scene) == ["contact"]  # another press, although the first is still latched
    scene.pressed = False
    scene.tick(30)
    assert noted(scene, Reset(scene.echo, scene.latched())) == ["reset"]
    assert noted(scene, Reset(scene.echo, (1,))) == ["reset_refused"]


def test_a_change_of_source_is_told() -> None:
    scene = Scene().ready()
    for _ in range(15):
        assert ticked(scene) == []
    assert ticked(scene) == ["stop", "source"]


def test_a_release_is_told_when_it_begins_and_ends() -> None:
    scene = hit()
    held = Hold(True, "backward", scene.echo)
    assert noted(scene, held) == ["source", "release"]
    assert noted(scene, held) == []
    assert noted(scene, Hold(False)) == ["stop", "source", "release_end"]


def test_what_changes_is_told_at_once_and_distances_are_not_a_change() -> None:
    scene = Scene().running()
    scene.sonar(front=1.0)
    scene.drive(1.0)
    before = signature(scene.state)
    scene.sonar(front=0.9)
    scene.drive(1.0)
    assert signature(scene.state) == before
    scene.estop()
    assert signature(scene.state) != before
    before = signature(scene.state)
    held = dict(scene.state.latches)
    held["estop"] = replace(held["estop"], id=1)
    assert signature(replace(scene.state, latches=held)) != before
    release = replace(scene.state.release, forbidden=frozenset({"forward"}))
    assert signature(replace(scene.state, release=release)) != before


def test_causes_are_told_with_their_identities() -> None:
    scene = hit()
    scene.estop()
    told = scene.tell()
    assert {cause.name: cause.id for cause in told.causes} == {
        name: one.id for name, one in scene.state.latches.items()
    }
    assert len({cause.id for cause in told.causes}) == len(told.causes)


def test_what_is_known_of_a_way_off_is_told_while_a_contact_is_latched() -> None:
    assert Scene().ready().tell().release is None
    scene = hit()
    first = scene.tell().release
    assert first is not None
    assert (first.believed_free, first.forbidden) == ("backward", ())
    scene.tick(50)
    later = scene.tell().release
    assert later is not None
    assert first.age is not None
    assert later.age == pytest.approx(first.age + 1.0)
    forbid: frozenset[Direction] = frozenset({"backward", "forward"})
    scene.state = replace(scene.state, release=replace(scene.state.release, forbidden=forbid))
    told = scene.tell().release
    assert told is not None
    assert (told.believed_free, told.forbidden) == (None, ("backward", "forward"))
