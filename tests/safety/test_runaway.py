"""Runaway detection on one axis."""

import pytest

from services.safety.runaway import Axis, Bounds

BOUNDS = Bounds(deceleration=0.6, tolerance=0.3, against=0.1, patience_s=0.3)


def follow(axis: Axis, commanded: float, measured: float, seconds: float) -> Axis:
    for _ in range(round(seconds / 0.02)):
        axis = axis.follow(commanded, measured, 0.02, BOUNDS)
    return axis


@pytest.mark.parametrize(
    ("commanded", "measured", "bad"),
    [
        (0.5, 0.5, False),
        (0.5, 0.8, False),
        (0.5, 0.81, True),
        (-0.5, -0.81, True),
        (-0.5, -0.79, False),
        (0.5, 0.0, False),
        (0.5, -0.1, False),
        (0.5, -0.11, True),
        (-0.5, 0.11, True),
        (-0.5, 0.1, False),
        (0.0, 0.3, False),
        (0.0, 0.31, True),
        (0.0, -0.31, True),
    ],
)
def test_what_counts_as_running_away(commanded: float, measured: float, bad: bool) -> None:
    assert (follow(Axis(), commanded, measured, 0.28).bad_s > 0.27) == bad


def test_slowing_down_as_it_must_is_no_runaway() -> None:
    axis = follow(Axis(), 1.0, 1.0, 1.0)
    for step in range(100):
        late_s = max(0.0, step * 0.02 - 0.25)
        axis = axis.follow(0.0, max(0.0, 1.0 - 0.6 * late_s), 0.02, BOUNDS)
        assert axis.bad_s == 0


def test_bad_time_is_forgiven_half_as_fast_and_never_piles_up() -> None:
    axis = follow(Axis(), 0.0, 1.0, 9.0)
    assert axis.bad_s == BOUNDS.patience_s
    assert follow(axis, 0.0, 0.0, 0.2).bad_s == pytest.approx(0.2)
    axis = Axis()
    for _ in range(20):  # flapping
        axis = follow(follow(axis, 0.0, 1.0, 0.04), 0.0, 0.0, 0.04)
    assert axis.bad_s > 0.27
