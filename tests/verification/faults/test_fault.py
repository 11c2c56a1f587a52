"""Rows of the fault campaign: unrequested motion and violations."""

from dataclasses import replace

import pytest

from sim.trace import Command
from t2 import messages
from verification.faults.fault import STALL_S, Fault, Outcome, Row, Sample, unrequested

RUN, STOP, BRAKE = messages.Command
FAULT = Fault("it", lambda _: 0, ("after a neutral",))


def command(kind: messages.Command = RUN, linear: float = 0.8, angular: float = 0.0) -> Command:
    return Command(mono_ns=0, kind=kind, linear=linear, angular=angular)


def sample(stopped_s: float | None = 0.01, moved_s: float = 0.0, **rest: object) -> Sample:
    given = {"outcome": "after a neutral", "fault_ns": 0} | rest
    return Sample(stopped_s, moved_s, **given)  # type: ignore[arg-type]


def row(*samples: Sample, budget_s: float | None = 0.02, stall_s: float = 0.0) -> Row:
    return Row(FAULT, budget_s, samples, [stall_s] * len(samples))


def stalled(allowed: Outcome, outcome: Outcome) -> Row:
    """Return a row in whose sample the host stalled."""
    made = replace(FAULT, outcome=(allowed,))
    return Row(made, None, [sample(outcome=outcome)], [2 * STALL_S])


@pytest.mark.parametrize(
    ("one", "is_unrequested"),
    [
        (command(), False),
        (command(linear=0.0), False),
        (command(STOP, -1.0), False),
        (command(linear=0.82), True),
        (command(linear=-0.1), True),
        (command(angular=0.1), True),
    ],
)
def test_unrequested_motion(one: Command, is_unrequested: bool) -> None:
    assert unrequested([command(), one]) is is_unrequested


@pytest.mark.parametrize(
    ("made", "found"),
    [
        (row(sample(0.020)), []),
        (row(sample(0.0201)), ["20.1 ms, 20.0 ms are allowed"]),
        (row(sample(0.010, 0.5)), ["500.0 ms, 20.0 ms are allowed"]),
        (row(sample(None)), ["never, 20.0 ms are allowed"]),
        (row(sample(0.025), stall_s=0.006), []),
        (row(sample(0.025, death_s=0.004)), ["25.0 ms, 24.0 ms are allowed"]),
        (row(sample(None), budget_s=None), []),
        (row(sample(outcome="by itself")), ["by itself, not after a neutral"]),
        (stalled("drives on", "after a neutral"), []),
        (stalled("after a neutral", "by itself"), ["by itself, not after a neutral"]),
        (stalled("drives on", "after a reset"), ["after a reset, not drives on"]),
        (stalled("after a reset", "after a neutral"), ["after a neutral, not after a reset"]),
        (row(sample(outcome=None)), ["does not drive again, not after a neutral"]),
        (row(sample(unrequested=True)), ["a motion command without a request"]),
        (row(sample(ended=("odom",))), ["odom ended"]),
    ],
)
def test_violations(made: Row, found: list[str]) -> None:
    assert made.violations == found
