"""Results of artificial traces: measured values, and the condition of a good lap."""

from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from cli.demo.score import Result, Trace, good, odometry_error, read, results
from tests.cli.demo.lap_fixture import TICK_NS, hit_lap, odometry, truth


def back(trace: Trace, x: float = 0.0) -> Trace:
    """Return a trace that ends at the start."""
    return replace(trace, truth=[*trace.truth, truth(91, x=x, distance=4.0)])


def named(rows: list[Result]) -> dict[str, tuple[str, bool]]:
    return {what: (amount, fine) for what, amount, fine in rows}


NEAR = [truth(0, clearance=None), truth(1, clearance=0.05)]


@pytest.mark.parametrize(
    ("trace", "wrong"),
    [
        (back(hit_lap()), set()),
        (back(hit_lap(brakes=False)), {"contact 1: frame to BRAKE frame"}),
        (
            hit_lap(stands=False),
            {"contact 1: stopped within", "distance from the start at the end"},
        ),
        (replace(hit_lap(), truth=NEAR), {"closest to an obstacle", "contact 1: stopped within"}),
        (back(hit_lap(), x=0.26), {"distance from the start at the end"}),
    ],
)  # fmt: skip
def test_results_of_a_lap(trace: Trace, wrong: set[str]) -> None:
    rows = results(trace, [])
    assert {what for what, _, fine in rows if not fine} == wrong
    assert good(rows) is not bool(wrong)
    if not wrong:
        assert {what: amount for what, amount, _ in rows} == {
            "closest to an obstacle": "1.00 m",
            "odometry error, at rest": "0.0 cm at most",
            "distance from the start at the end": "0.0 cm",
            "contact 1: frame to BRAKE frame": "20.0 ms",
            "contact 1: stopped within": "4.0 cm",
        }
    assert not good(results(replace(trace, bumper=[]), []))  # no contact


@pytest.mark.parametrize(
    ("tick", "x", "error"),
    [
        (30, 99.0, 0.0),  # driving
        (80, 2.04 - 0.16, 0.16),  # at rest
        (0, 99.0, 0.0),  # before the trace
    ],
)
def test_the_error_of_odometry_counts_at_rest(tick: int, x: float, error: float) -> None:
    poses = [odometry(mono_ns=tick * TICK_NS, x=x)]
    assert odometry_error(hit_lap(), poses) == pytest.approx(error)
    rows = named(results(back(hit_lap()), poses))
    assert rows["odometry error, at rest"][1] is (error == 0.0)


def test_a_trace_is_read_up_to_the_last_whole_line(tmp_path: Path) -> None:
    trace = hit_lap()
    file = tmp_path / "trace.jsonl"
    lines = [*trace.truth, *trace.commands, *trace.bumper]
    encoded = b"".join(msgspec.json.encode(line) + b"\n" for line in lines)
    file.write_bytes(encoded + b'{"event":"tru')
    again = read(file)
    assert (again.truth, again.commands, again.bumper) == (
        trace.truth, trace.commands, trace.bumper,
    )  # fmt: skip
