"""Results of artificial traces: measured values, and the condition of a good lap."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import pytest

from cli.demo.record import LapRecord
from cli.demo.score import Result, Trace, good, odometry_errors, read, results, stops
from tests.cli.demo.lap_fixture import TICK_NS, hit_lap, odometry, truth


def finished(**fields: Any) -> LapRecord:
    """Return the record of a fast lap."""
    usual: dict[str, Any] = {"steps": ["step"] * 9, "finished": True}
    return LapRecord(**(usual | fields))


def named(rows: list[Result]) -> dict[str, tuple[str, bool | None]]:
    return {what: (amount, fine) for what, amount, fine in rows}


def test_a_stop_is_measured_from_frame_to_frame() -> None:
    (stop,) = stops(hit_lap())
    assert stop.reaction_s == pytest.approx(0.02)
    assert stop.distance_m == pytest.approx(0.04)
    assert stop.speed_mps == 0.8


def test_a_good_lap() -> None:
    rows = results(hit_lap(), finished(), fast=True)
    assert named(rows) == {
        "lap finished": ("9 steps", True),
        "distance driven": ("2.04 m", True),
        "closest to an obstacle": ("1.00 m", True),
        "odometry error, driving": ("0.0 cm at most", None),
        "odometry error, at rest": ("0.0 cm at most", True),
        "contact 1: frame to BRAKE frame": ("20.0 ms", True),
        "contact 1: stopped within": ("4.0 cm from 0.80 m/s", True),
        "unplanned latches": ("none", None),
    }
    assert good(rows)


def wrong(trace: Trace, driven: LapRecord | None = None, fast: bool = True) -> set[str]:
    """Return the failed results of a lap."""
    rows = results(trace, driven or finished(), fast)
    assert not good(rows)
    return {what for what, _, fine in rows if fine is False}


def test_an_unfinished_lap() -> None:
    assert wrong(hit_lap(), finished(finished=False)) == {"lap finished"}


def test_a_vehicle_that_brakes_without_a_frame() -> None:
    trace = hit_lap(brakes=False)
    assert wrong(trace) == {"contact 1: frame to BRAKE frame"}
    assert stops(trace)[0].reaction_s is None


def test_a_vehicle_without_standstill() -> None:
    trace = hit_lap(stands=False)
    assert wrong(trace) == {"contact 1: stopped within"}
    amount, _ = named(results(trace, finished(), fast=True))["contact 1: stopped within"]
    assert amount == "never from 0.80 m/s"


def test_a_trace_cut_off_at_the_hit() -> None:
    whole = hit_lap()
    cut = Trace(whole.truth[:51], whole.commands[:1], whole.bumper)
    assert wrong(cut) == {"contact 1: frame to BRAKE frame", "contact 1: stopped within"}


def test_a_hit_before_the_first_truth() -> None:
    trace = replace(hit_lap(), truth=hit_lap().truth[60:])
    assert [(stop.distance_m, stop.speed_mps) for stop in stops(trace)] == [(0.0, 0.0)]


def test_a_lap_without_a_contact_is_not_good() -> None:
    trace = replace(hit_lap(), bumper=[])
    assert wrong(trace) == set()


def test_too_close_and_not_driven() -> None:
    near = replace(hit_lap(), truth=[truth(0, clearance=None), truth(1, clearance=0.05)])
    assert {"closest to an obstacle", "distance driven"} <= wrong(near)


@pytest.mark.parametrize(("x", "home"), [(0.24, True), (0.26, False)])
def test_the_whole_lap_ends_at_the_start(x: float, home: bool) -> None:
    trace = hit_lap()
    back = replace(trace, truth=[*trace.truth, truth(91, x=x, distance=4.0)])
    rows = results(back, finished(), fast=False)
    assert named(rows)["distance from the start at the end"] == (f"{x * 100:.1f} cm", home)
    assert good(rows) is home


def test_unplanned_latches_are_named() -> None:
    driven = finished(unplanned=["runaway"])
    assert results(hit_lap(), driven, fast=True)[-1][1] == "runaway"


# --- odometry ---------------------------------------------------------------------------------


def test_odometry_is_compared_with_interpolated_truth() -> None:
    half = odometry(mono_ns=round(30.5 * TICK_NS), x=30.5 * 0.04)
    driving, resting = odometry_errors(hit_lap(), [half])
    assert driving == pytest.approx(0.0, abs=1e-9)
    assert resting == 0.0


def test_only_the_odometry_error_at_rest_fails() -> None:
    moving = odometry(mono_ns=30 * TICK_NS, x=30 * 0.04 - 0.3, y=0.4)
    standing = odometry(mono_ns=80 * TICK_NS, x=2.04 - 0.16)
    assert list(odometry_errors(hit_lap(), [moving])) == pytest.approx([0.5, 0.0])
    assert list(odometry_errors(hit_lap(), [standing])) == pytest.approx([0.16, 0.16])
    assert good(results(hit_lap(), finished(odometry=[moving]), fast=True))
    assert not good(results(hit_lap(), finished(odometry=[standing]), fast=True))


@pytest.mark.parametrize("tick", [0, 19, 91, 1000])
def test_odometry_outside_of_the_trace_is_left_out(tick: int) -> None:
    assert odometry_errors(hit_lap(), [odometry(mono_ns=tick * TICK_NS, x=99.0)]) == (0.0, 0.0)


# --- the file ---------------------------------------------------------------------------------


def test_a_trace_is_read_up_to_the_last_whole_line(tmp_path: Path) -> None:
    trace = hit_lap()
    file = tmp_path / "trace.jsonl"
    lines = [*trace.truth, *trace.commands, *trace.bumper]
    encoded = b"".join(msgspec.json.encode(line) + b"\n" for line in lines)
    file.write_bytes(encoded + b'{"event":"tru')
    again = read(file)
    assert again.truth == trace.truth
    assert again.commands == trace.commands
    assert again.bumper == trace.bumper
