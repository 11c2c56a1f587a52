"""What a row says of its samples."""

import math
from dataclasses import replace

import pytest

from common import motion
from sim.trace import Command
from verification.faults.frames import first_stop_s, last_move_s, strayed
from verification.faults.table import Row, markdown, rank, renewed, times, verdict
from verification.faults.trial import Sample

RUN, STOP, BRAKE = motion.Command


def command(
    ms: float,
    kind: motion.Command = RUN,
    linear: float = 0.8,
    angular: float = 0.0,
) -> Command:
    return Command(mono_ns=round(ms * 1e6), kind=kind, linear=linear, angular=angular)


def sample(told_s: float | None = 0.01, moved_s: float = 0.0, **rest: object) -> Sample:
    given = {"outcome": "after a neutral", "fault_ns": 0} | rest
    return Sample(told_s, moved_s, **given)  # type: ignore[arg-type]


def row(*samples: Sample, budget_s: float | None = 0.02, held_up_s: float = 0.0) -> Row:
    return Row("it", budget_s, ("after a neutral",), samples, [held_up_s] * len(samples))


def test_the_first_stop_and_the_last_move_after_a_fault() -> None:
    made = [
        command(0, STOP, 0), command(90), command(100), command(110), command(120, BRAKE, 0),
        command(130), command(140, STOP, 0), command(150, linear=0.0),
    ]  # fmt: skip
    assert first_stop_s(made, round(100e6)) == pytest.approx(0.020)
    assert last_move_s(made, round(100e6)) == pytest.approx(0.030)
    assert first_stop_s(made[:4], round(100e6)) is None
    assert last_move_s(made, round(131e6)) == 0.0


@pytest.mark.parametrize(
    ("one", "stray"),
    [
        (command(0), False),
        (command(0, linear=0.0), False),
        (command(0, STOP, -1.0), False),
        (command(0, linear=0.82), True),
        (command(0, linear=-0.1), True),
        (command(0, angular=0.1), True),
    ],
)
def test_what_nobody_asked_for(one: Command, stray: bool) -> None:
    assert strayed([command(0), one]) is stray


def test_both_the_first_stop_and_the_last_move_count() -> None:
    made = [sample(0.010, 0.0), sample(0.010, 0.030), sample(None, 0.0)]
    assert times(made) == [0.010, 0.030, math.inf]


@pytest.mark.parametrize(("share", "value"), [(0.5, 10), (0.99, 20), (1.0, 20), (0.05, 1)])
def test_ranks_are_values_that_were_measured(share: float, value: float) -> None:
    assert rank(range(20, 0, -1), share) == value


@pytest.mark.parametrize(
    ("made", "found"),
    [
        (row(sample(0.020)), []),
        (row(sample(0.0201)), ["20.1 ms, 20.0 are allowed"]),
        (row(sample(0.010, 0.5)), ["500.0 ms, 20.0 are allowed"]),
        (row(sample(None)), ["inf ms, 20.0 are allowed"]),
        (row(sample(0.025), held_up_s=0.006), []),
        (row(sample(0.025, death_s=0.006)), []),
        (row(sample(0.025, death_s=0.004)), ["25.0 ms, 24.0 are allowed"]),
        (row(sample(None), budget_s=None), []),
        (row(sample(outcome="by itself")), ["by itself, not after a neutral"]),
        (row(sample(outcome=None)), ["would not drive again, not after a neutral"]),
        (row(sample(strayed=True)), ["a command that nobody asked for"]),
        (row(sample(died=("odom",))), ["odom ended"]),
    ],
)
def test_what_is_not_as_it_should_be(made: Row, found: list[str]) -> None:
    assert made.faults == found


def test_a_table_for_people() -> None:
    text = markdown([
        row(sample(0.001), sample(0.002)),
        row(sample(outcome=None), sample(None), budget_s=None),
    ])  # fmt: skip
    assert "| it | 2 | 20.0 ms | 1.0 ms | 2.0 ms | 2.0 ms | 0.0 ms | after a neutral | ok |" in text
    assert "| it | 2 |  |  |  |  | 0.0 ms |" in text
    assert "would not drive again 1" in text
    assert "WRONG" in text


def test_rows_that_are_measured_again_take_their_places_and_it_is_said() -> None:
    good = replace(row(sample()), name="a")
    bad = replace(row(sample(outcome="by itself")), name="b")
    before = f"# Faults\n\n{markdown([good, bad])}\n{verdict(['b'])}\n"
    after = renewed(before, [replace(good, name="b")], "2026-01-02")
    assert after == (
        f"# Faults\n\n{markdown([good, replace(good, name='b')])}\n"
        "Measured again by themselves on 2026-01-02: b.\n\nAll are as they should be.\n"
    )
    still = renewed(before, [good], "2026-01-02")
    assert still.endswith("2026-01-02: a.\n\nNot as it should be: b.\n")


def test_a_row_that_the_document_does_not_have_is_added_to_its_table() -> None:
    good = replace(row(sample()), name="a")
    before = f"# Faults\n\n{markdown([good])}\n{verdict([])}\n"
    after = renewed(before, [replace(good, name="b")], "2026-01-02")
    assert markdown([good, replace(good, name="b")]) in after
