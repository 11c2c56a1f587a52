"""Latch tests of bumper and emergency stop: complete ones, and each missing part."""

import pytest

from cli.commission.latches import LIMIT_S, LatchTest, Reset, judge_latch
from common.freshness import NS_PER_S, Latest
from t2.messages import Command, Motion, SafetyState
from tests.factories import safety_state

T = 100 * NS_PER_S
RESET = Reset(T + 2 * NS_PER_S, True, "Reset.", ())


def state(after_s: float, *latched: str) -> Latest[SafetyState]:
    return Latest(safety_state(latched=latched), T + round(after_s * NS_PER_S))


def motion(after_s: float, command: Command) -> Latest[Motion]:
    return Latest(Motion(command=command), T + round(after_s * NS_PER_S))


def latch_test() -> LatchTest:
    return LatchTest(
        cause="estop",
        at_ns=T,
        states=[state(-0.1), state(0.02, "estop"), state(0.07, "estop")],
        motions=[
            motion(-0.1, Command.STOP),
            motion(0.01, Command.BRAKE),
            motion(0.03, Command.BRAKE),
        ],
        reset=RESET,
    )


def test_a_complete_test_passes_with_its_times() -> None:
    verdict = judge_latch(latch_test())
    assert (verdict.outcome, verdict.text) == ("passed", "Latched, braked, reset.")
    assert dict(verdict.data) == {
        "latch estop after": "0.020 s",
        "command BRAKE after": "0.010 s",
        "BRAKE commands received": "2",
        "reset": "Reset.",
    }


def test_a_state_that_overtakes_its_cause_and_commands_after_the_reset_pass() -> None:
    test = latch_test()
    early, late = [state(-0.01, "estop")], [*test.motions, motion(2.01, Command.STOP)]
    verdict = judge_latch(test._replace(states=early, motions=late))
    assert verdict.outcome == "passed"
    assert dict(verdict.data)["latch estop after"] == "0.000 s"


@pytest.mark.parametrize(
    ("change", "phrase"),
    [
        ({"states": [state(0.02, "contact")]}, "Safety did not latch estop."),
        ({"states": [state(LIMIT_S + 0.01, "estop")]}, "Safety took 0.51 s to latch estop"),
        ({"motions": [motion(0.01, Command.STOP)]}, "Safety did not command BRAKE."),
        ({"motions": [motion(0.6, Command.BRAKE)]}, "Safety took 0.60 s to command BRAKE"),
        ({"motions": [motion(0.01, Command.BRAKE), motion(0.03, Command.RUN)]}, "safety sent RUN"),
        ({"reset": RESET._replace(granted=False, text="It moves.")}, "failed: It moves."),
        ({"reset": RESET._replace(latched=("estop",))}, "Latched after the reset: estop."),
    ],
)
def test_missing_parts_are_named(change: dict[str, object], phrase: str) -> None:
    verdict = judge_latch(latch_test()._replace(**change), "It stays pressed.")  # type: ignore[arg-type]
    assert verdict.outcome == "failed"
    assert verdict.text.startswith("It stays pressed. ")
    assert phrase in verdict.text
