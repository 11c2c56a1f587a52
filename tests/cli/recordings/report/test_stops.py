"""Stops commanded by safety, and their reasons."""

from cli.recordings.report.stops import Phase, Phases, stops
from common.messages import Cause, SafetyState, Verdict
from tests.cli.recordings.report.drive_fixture import CONTACT, IDLE, state

LINK = Cause(name="link", action="stop", age=0.0, text="The link to the board is lost.")
SLOWED = Cause(name="obstacle", action="slow", age=0.0, text="Slowed by an obstacle.")


def phases_of(*steps: tuple[float, float, Verdict, tuple[Cause, ...]]) -> list[Phase[SafetyState]]:
    """Return phases from begin, end, verdict and causes."""
    made = []
    for begins_s, ends_s, verdict, causes in steps:
        latched = tuple(cause.name for cause in causes if cause is CONTACT)
        known = state(False)
        made_state = SafetyState(
            verdict=verdict, latched=latched, causes=causes, source=None, limits=known.limits,
            heartbeat=1, text="",
        )  # fmt: skip
        made.append(Phase(begins_s, ends_s, made_state))
    return made


def test_a_contact_while_driving_with_a_reset() -> None:
    (stop,) = stops(
        phases_of((0, 2, "run", ()), (2, 5, "brake", (CONTACT, IDLE)), (5, 9, "stop", (IDLE,)))
    )
    assert (stop.begins_s, stop.ends_s, stop.lasts_s) == (2, 5, 3)
    assert (stop.was_driving, stop.verdict, stop.over) == (True, "brake", True)
    assert stop.reasons == {"contact": "The bumper was hit."}
    assert list(stop.latched) == ["contact"]


def test_consecutive_reasons_are_one_stop() -> None:
    (stop,) = stops(
        phases_of((0, 1, "inhibited", (LINK,)), (1, 2, "brake", (CONTACT, LINK)), (2, 3, "run", ()))
    )
    assert list(stop.reasons) == ["link", "contact"]
    assert (stop.verdict, stop.ends_s, stop.was_driving) == ("inhibited", 2, False)


def test_an_idle_vehicle_is_not_a_stop() -> None:
    assert stops(phases_of((0, 5, "stop", (IDLE,)), (5, 9, "slow", (SLOWED,)))) == []


def test_a_stop_at_the_end_is_not_over() -> None:
    (stop,) = stops(phases_of((0, 1, "run", ()), (1, 2, "inhibited", (LINK,))))
    assert not stop.over


def test_a_gap_in_the_safety_state_ends_a_stop() -> None:
    first, second = stops(phases_of((0, 1, "inhibited", (LINK,)), (4, 5, "inhibited", (LINK,))))
    assert (first.ends_s, first.over) == (1, False)
    assert (second.begins_s, second.over) == (4, False)


def test_phases_end_with_the_next_state_or_a_gap() -> None:
    phases: Phases[str] = Phases(gap_s=0.5)
    for at_s, word in ((0.0, "a"), (0.3, "a"), (0.6, "b"), (2.0, "b"), (2.1, "b")):
        phases.add(at_s, word, word)
    found = [(phase.begins_s, phase.ends_s, phase.state) for phase in phases.done]
    assert found == [(0.0, 0.6, "a"), (0.6, 0.6, "b"), (2.0, 2.1, "b")]
    assert phases.done[0].lasts_s == 0.6
