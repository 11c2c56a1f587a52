"""What a fix measures, and whether two fixes agree: the limits of both."""

import pytest
from msgspec.structs import replace

from common.pose import Covariance, Pose
from services.localization.config import FixSource
from services.localization.core.estimate import POSE, POSITION, Measured, Sample
from services.localization.core.fixes import FROZEN_M, SourceState, TakenFix, measured_of
from t2.messages import Fix, Phrase
from t2.words import render

CERTAIN = Covariance(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
# Of two fixes together: 1 m, and 0.5 rad.
HALF = Covariance(0.25, 0.0, 0.25, 0.0, 0.0, 0.125)
HERE = Pose(0.0, 0.0, 0.0)


def taken(odometry: Pose, measured: Pose, values: int = POSE) -> TakenFix:
    """Return a fix at a pose of odometry without errors."""
    return TakenFix(Sample(1, odometry, CERTAIN, 0), Measured(measured, HALF, values))


@pytest.mark.parametrize(("x", "has_left"), [(FROZEN_M, False), (-FROZEN_M - 0.001, True)])
def test_a_vehicle_has_left_after_five_centimetres(x: float, has_left: bool) -> None:
    assert taken(Pose(0.0, x, 0.0), HERE).has_left(taken(HERE, HERE)) == has_left


@pytest.mark.parametrize(
    ("driven", "apart", "agrees"),
    [
        # 3.3 standard deviations around the way that odometry shows
        ((3.0, 4.0), 8.25, True),
        ((3.0, 4.0), 8.35, False),
        ((3.0, 4.0), 1.75, True),
        ((3.0, 4.0), 1.65, False),
        ((0.0, 0.0), 3.3, True),
    ],
)
def test_two_fixes_are_as_far_apart_as_odometry_says(
    driven: tuple[float, float], apart: float, agrees: bool
) -> None:
    first, second = taken(HERE, HERE), taken(Pose(*driven, 0.0), Pose(0.0, apart, 0.0))
    assert second.agrees(first) == agrees


@pytest.mark.parametrize(
    ("turned", "measured", "values", "agrees"),
    [
        (1.0, 1.0, POSE, True),
        (1.0, 2.6, POSE, True),
        (1.0, 2.7, POSE, False),
        (1.0, -0.7, POSE, False),
        (0.0, 1.65, POSE, True),
        (1.0, -0.7, POSITION, True),
    ],
)
def test_two_fixes_are_turned_as_odometry_says(
    turned: float, measured: float, values: int, agrees: bool
) -> None:
    first = taken(Pose(0.0, 0.0, 0.5), HERE)
    second = taken(Pose(0.0, 0.0, 0.5 + turned), Pose(0.0, 0.0, measured), values)
    assert second.agrees(first) == agrees


def test_a_refused_fix_is_published_with_its_reason() -> None:
    reason = Phrase("fix.repeated")
    state = SourceState(FixSource(), reason=reason).message("tags", 0)
    assert (state.phrases, state.text) == ((reason,), render((reason,)))


FIX = Fix(
    x=1.0, y=2.0, heading=0.5, odom_boot=1, odom_seq=1,
    covariance=(0.04, 0.0, 0.0, 0.0, 0.09, 0.0, 0.0, 0.0, 0.01),
)  # fmt: skip
MOVING = Sample(1, HERE, CERTAIN, 0, step=(0.6, 0.3))
SOURCE = FixSource(sigma=0.1, heading_sigma=0.2)


def test_settings_and_the_motion_until_the_next_sample_are_added() -> None:
    measured = measured_of(FIX, MOVING, SOURCE)
    assert measured is not None
    assert (measured.pose, measured.values) == (Pose(1.0, 2.0, 0.5), POSE)
    # 0.1² + 0.6² / 12, and 0.2² + 0.3² / 12
    expected = 0.04 + 0.04, 0.0, 0.0, 0.0, 0.09 + 0.04, 0.0, 0.0, 0.0, 0.01 + 0.0475
    assert measured.covariance.rows() == pytest.approx(expected)


def test_a_position_has_no_heading() -> None:
    measured = measured_of(replace(FIX, heading=None), MOVING, SOURCE)
    assert measured is not None
    assert (measured.pose, measured.values) == (Pose(1.0, 2.0, 0.0), POSITION)


@pytest.mark.parametrize(
    ("above", "below", "is_one"),
    [
        (0.01, 0.01 * (1 + 5e-7), True),
        (0.01, 0.01 * (1 + 2e-6), False),
        (0.01, 0.0101, False),
        (0.0, 1e-13, True),
    ],
)
def test_a_covariance_is_symmetric_but_for_rounding(
    above: float, below: float, is_one: bool
) -> None:
    covariance = (0.04, above, 0.0, below, 0.09, 0.0, 0.0, 0.0, 0.01)
    made = measured_of(replace(FIX, covariance=covariance), MOVING, SOURCE)
    assert (made is not None) == is_one
