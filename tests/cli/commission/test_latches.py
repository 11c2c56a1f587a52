"""Trips of bumper and emergency stop: whole ones, and each thing that may be missing."""

from dataclasses import replace

import pytest

from cli.commission.latches import PROMPT_S, Reset, Trip, judge_bumper, judge_estop
from common.freshness import NS_PER_S, Latest
from common.messages import Motion, SafetyState
from common.motion import Command
from tests.cli.demo.lap_fixture import safety

T = 100 * NS_PER_S
RESET = Reset(T + 2 * NS_PER_S, True, "Reset.", ())


def state(after_s: float, *latched: str) -> Latest[SafetyState]:
    return Latest(safety(latched=latched), T + round(after_s * NS_PER_S))


def motion(after_s: float, command: Command) -> Latest[Motion]:
    return Latest(Motion(command=command), T + round(after_s * NS_PER_S))


def trip(cause: str = "estop") -> Trip:
    return Trip(
        cause=cause,
        at_ns=T,
        gone=True,
        states=[state(-0.1), state(0.02, cause), state(0.07, cause)],
        motions=[
            motion(-0.1, Command.STOP),
            motion(0.01, Command.BRAKE),
            motion(0.03, Command.BRAKE),
        ],
        reset=RESET,
    )


def test_a_whole_trip_passes_with_its_times() -> None:
    verdict = judge_estop(trip())
    assert (verdict.outcome, verdict.text) == ("passed", "Stopped, latched, reset.")
    assert dict(verdict.data) == {
        "latched after": "0.020 s",
        "BREAK commanded after": "0.010 s",
        "BREAK commands heard": "2",
        "reset": "Reset.",
    }


def test_a_state_that_overtakes_its_cause_took_no_time() -> None:
    verdict = judge_estop(replace(trip(), states=[state(-0.01, "estop")]))
    assert dict(verdict.data)["latched after"] == "0.000 s"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"states": [state(0.02)]}, "Safety did not latch estop."),
        ({"states": [state(0.02, "contact")]}, "Safety did not latch estop."),
        ({"states": [state(PROMPT_S + 0.01, "estop")]}, "It took safety 0.51 s to latch estop"),
        ({"motions": [motion(0.01, Command.STOP)]}, "Safety did not command BREAK."),
        ({"motions": []}, "Safety did not command BREAK."),
        ({"motions": [motion(0.6, Command.BRAKE)]}, "It took safety 0.60 s to command BREAK"),
        (
            {
                "motions": [
                    motion(0.01, Command.BRAKE),
                    motion(0.03, Command.RUN),
                    motion(0.05, Command.STOP),
                ]
            },
            "safety sent RUN, STOP in place of BREAK",
        ),
        ({"reset": None}, "No reset was tried."),
        ({"reset": replace(RESET, granted=False, text="It moves.")}, "was refused: It moves."),
        ({"reset": replace(RESET, latched=("estop",))}, "still latched: estop."),
    ],
)
def test_what_is_missing_is_named(change: dict[str, object], said: str) -> None:
    verdict = judge_estop(replace(trip(), **change))  # type: ignore[arg-type]
    assert verdict.outcome == "failed"
    assert said in verdict.text


def test_it_is_in_time_to_the_last_moment() -> None:
    late = replace(
        trip(), states=[state(PROMPT_S, "estop")], motions=[motion(PROMPT_S, Command.BRAKE)]
    )
    assert judge_estop(late).outcome == "passed"


def test_what_is_sent_after_the_reset_is_none_of_it() -> None:
    more = [*trip().motions, motion(2.01, Command.STOP)]
    assert judge_estop(replace(trip(), motions=more)).outcome == "passed"


# --- bumper ---------------------------------------------------------------------------------------


def test_a_press_and_a_release_pass() -> None:
    assert judge_bumper(trip("contact"), False).outcome == "passed"


@pytest.mark.parametrize(
    ("change", "before", "said"),
    [
        ({}, True, "pressed before anybody pressed it"),
        ({"at_ns": None}, False, "No press was seen"),
        ({"gone": False}, False, "stays pressed"),
        ({"states": []}, False, "Safety did not latch contact."),
    ],
)
def test_a_bumper_that_does_not_work_is_named(
    change: dict[str, object], before: bool, said: str
) -> None:
    verdict = judge_bumper(replace(trip("contact"), **change), before)  # type: ignore[arg-type]
    assert verdict.outcome == "failed"
    assert said in verdict.text
