"""Rows of the fault campaign: reaction times, violations, the table."""

import math
from dataclasses import replace

import pytest

from common import motion
from sim.trace import Command
from verification.faults.table import Row, markdown, renewed, times, verdict
from verification.faults.trial import Sample, unrequested
from verification.harness.results import percentile

RUN, STOP, BRAKE = motion.Command


def command(
    ms: float,
    kind: motion.Command = RUN,
    linear: float = 0.8,
    angular: float = 0.0,
) -> Command:
    return Command(mono_ns=round(ms * 1e6), kind=kind, linear=linear, angular=angular)


def sample(stopped_s: float | None = 0.01, moved_s: float = 0.0, **rest: object) -> Sample:
    given = {"outcome": "after a neutral", "fault_ns": 0} | rest
    return Sample(stopped_s, moved_s, **given)  # type: ignore[arg-type]


def row(*samples: Sample, budget_s: float | None = 0.02, stall_s: float = 0.0) -> Row:
    return Row("it", budget_s, ("after a neutral",), samples, [stall_s] * len(samples))


@pytest.mark.parametrize(
    ("one", "is_unrequested"),
    [
        (command(0), False),
        (command(0, linear=0.0), False),
        (command(0, STOP, -1.0), False),
        (command(0, linear=0.82), True),
        (command(0, linear=-0.1), True),
        (command(0, angular=0.1), True),
    ],
)
def test_unrequested_motion(one: Command, is_unrequested: bool) -> None:
    assert unrequested([command(0), one]) is is_unrequested


def test_both_the_first_stop_and_the_last_move_count() -> None:
    made = [sample(0.010, 0.0), sample(0.010, 0.030), sample(None, 0.0)]
    assert times(made) == [0.010, 0.030, math.inf]


@pytest.mark.parametrize(("share", "value"), [(0.5, 10), (0.99, 20), (1.0, 20), (0.05, 1)])
def test_percentiles_are_measured_values(share: float, value: float) -> None:
    assert percentile(range(20, 0, -1), share) == value


@pytest.mark.parametrize(
    ("made", "found"),
    [
        (row(sample(0.020)), []),
        (row(sample(0.0201)), ["20.1 ms, 20.0 are allowed"]),
        (row(sample(0.010, 0.5)), ["500.0 ms, 20.0 are allowed"]),
        (row(sample(None)), ["inf ms, 20.0 are allowed"]),
        (row(sample(0.025), stall_s=0.006), []),
        (row(sample(0.025, death_s=0.006)), []),
        (row(sample(0.025, death_s=0.004)), ["25.0 ms, 24.0 are allowed"]),
        (row(sample(None), budget_s=None), []),
        (row(sample(outcome="by itself")), ["by itself, not after a neutral"]),
        (row(sample(outcome=None)), ["does not drive again, not after a neutral"]),
        (row(sample(unrequested=True)), ["a motion command without a request"]),
        (row(sample(ended=("odom",))), ["odom ended"]),
    ],
)
def test_violations(made: Row, found: list[str]) -> None:
    assert made.faults == found


def test_the_table() -> None:
    text = markdown([
        row(sample(0.001), sample(0.002)),
        row(sample(outcome=None), sample(None), budget_s=None),
    ])  # fmt: skip
    assert "| it | 2 | 20.0 ms | 1.0 ms | 2.0 ms | 2.0 ms | 0.0 ms | after a neutral | ok |" in text
    assert "| it | 2 |  |  |  |  | 0.0 ms |" in text
    assert "does not drive again 1" in text
    assert "WRONG" in text


def test_rows_measured_again_replace_the_old_ones_and_are_named() -> None:
    good = replace(row(sample()), name="a")
    bad = replace(row(sample(outcome="by itself")), name="b")
    before = f"# Faults\n\n{markdown([good, bad])}\n{verdict(['b'])}\n"
    after = renewed(before, [replace(good, name="b")], "2026-01-02")
    assert after == (
        f"# Faults\n\n{markdown([good, replace(good, name='b')])}\n"
        "Measured again separately on 2026-01-02: b.\n\nAll rows are within their limits.\n"
    )
    still = renewed(before, [good], "2026-01-02")
    assert still.endswith("2026-01-02: a.\n\nOutside their limits: b.\n")


def test_a_new_row_is_added_to_the_table() -> None:
    good = replace(row(sample()), name="a")
    before = f"# Faults\n\n{markdown([good])}\n{verdict([])}\n"
    after = renewed(before, [replace(good, name="b")], "2026-01-02")
    assert markdown([good, replace(good, name="b")]) in after
