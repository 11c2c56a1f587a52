"""Stops commanded by safety, and their reasons."""

import pytest

from cli.recordings.timeline import Phase, add_state, stops
from common.messages import Cause, SafetyState, Verdict
from tests.cli.recordings.drive_fixture import CONTACT, IDLE, state

LINK = Cause(name="link", action="stop", age=0.0, text="The link to the board is lost.")
SLOWED = Cause(name="obstacle", action="slow", age=0.0, text="Slowed by an obstacle.")


def made_of(
    verdict: Verdict, causes: tuple[Cause, ...], latched: tuple[str, ...] | None = None
) -> SafetyState:
    """Return a state; a contact among the causes is latched."""
    if latched is None:
        latched = tuple(cause.name for cause in causes if cause is CONTACT)
    return SafetyState(
        verdict=verdict, latched=latched, causes=causes, source=None, limits=state(False).limits,
        heartbeat=1, text="",
    )  # fmt: skip


def phases_of(*steps: tuple[float, float, Verdict, tuple[Cause, ...]]) -> list[Phase]:
    """Return phases from begin, end, verdict and causes."""
    return [
        Phase(begins_s, ends_s, made_of(verdict, causes))
        for begins_s, ends_s, verdict, causes in steps
    ]


def test_a_contact_while_driving_with_a_reset() -> None:
    (stop,) = stops(
        phases_of((0, 2, "run", ()), (2, 5, "brake", (CONTACT, IDLE)), (5, 9, "stop", (IDLE,)))
    )
    assert (stop.begins_s, stop.ends_s, stop.lasts_s) == (2, 5, 3)
    assert (stop.was_driving, stop.verdict, stop.over) == (True, "brake", True)
    assert stop.reasons == {"contact": "The bumper was hit."}
    assert (list(stop.latched), stop.ended_by) == (["contact"], "a reset")


def test_consecutive_reasons_are_one_stop() -> None:
    (stop,) = stops(
        phases_of((0, 1, "inhibited", (LINK,)), (1, 2, "brake", (CONTACT, LINK)), (2, 3, "run", ()))
    )
    assert list(stop.reasons) == ["link", "contact"]
    assert (stop.verdict, stop.ends_s, stop.was_driving) == ("inhibited", 2, False)
    (stop,) = stops(phases_of((0, 1, "stop", (LINK,)), (1, 2, "run", ())))
    assert stop.ended_by == "itself"


def test_an_idle_vehicle_is_not_a_stop() -> None:
    assert stops(phases_of((0, 5, "stop", (IDLE,)), (5, 9, "slow", (SLOWED,)))) == []


def test_a_gap_in_the_safety_state_ends_a_stop() -> None:
    first, second = stops(phases_of((0, 1, "inhibited", (LINK,)), (4, 5, "inhibited", (LINK,))))
    assert (first.ends_s, first.over) == (1, False)
    assert first.ended_by.startswith("not ended")
    assert (second.begins_s, second.over) == (4, False)


@pytest.mark.parametrize(
    ("later", "is_same"),
    [
        (made_of("brake", (CONTACT,)), True),
        (made_of("stop", (CONTACT,)), False),
        (made_of("brake", (CONTACT, LINK)), False),
        (made_of("brake", (CONTACT,), latched=()), False),
    ],
)
def test_a_phase_lasts_until_another_state(later: SafetyState, is_same: bool) -> None:
    phases: list[Phase] = []
    add_state(phases, 0.0, made_of("brake", (CONTACT,)), 0.5)
    add_state(phases, 0.5, later, 0.5)
    add_state(phases, 1.1, later, 0.5)  # after a gap
    assert [(phase.begins_s, phase.ends_s) for phase in phases] == (
        [(0.0, 0.5), (1.1, 1.1)] if is_same else [(0.0, 0.5), (0.5, 0.5), (1.1, 1.1)]
    )
