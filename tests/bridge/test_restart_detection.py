"""Detection of a restart of the board's counters."""

import math

import pytest

from common.messages import Mileage
from services.bridge.restart_detection import restarted


def at(distance: float, degrees: float = 0.0) -> Mileage:
    return Mileage(distance=distance, heading=math.radians(degrees), epoch=0)


@pytest.mark.parametrize(
    ("before", "after", "gap_s", "anew"),
    [
        # to zero: sooner than any driving
        (at(5.0), at(0.0), 0.02, True),
        (at(-5.0), at(0.0), 0.02, True),
        (at(0.0, 90.0), at(0.0), 0.02, True),
        (at(0.0, -179.0), at(0.0), 0.02, True),
        (at(0.051), at(0.0), 0.02, True),
        (at(0.049), at(0.0), 0.02, False),
        (at(0.051), at(0.0051), 0.02, False),
        (at(0.051), at(0.0, 0.6), 0.02, False),
        (at(0.0, 3.5), at(0.0), 0.02, True),
        (at(0.0, 3.4), at(0.0), 0.02, False),
        # through zero, with samples missing
        (at(0.3), at(0.0), 0.2, False),
        (at(0.33), at(0.0), 0.2, True),
        (at(0.33), at(0.0), 60.0, True),
        # anywhere: further than the vehicle can have moved
        (at(5.0), at(5.02), 0.02, False),
        (at(5.0), at(6.099), 0.02, False),
        (at(5.0), at(6.101), 0.02, True),
        (at(5.0), at(6.9), 0.2, False),
        (at(5.0), at(7.1), 0.2, True),
        (at(5.0), at(7.1), 60.0, True),
        (at(5.0, 0.0), at(5.0, 62.0), 0.02, False),
        (at(5.0, 0.0), at(5.0, 64.0), 0.02, True),
        # the wrap is no jump
        (at(5.0, 179.9), at(5.0, -179.9), 0.02, False),
        (at(5.0, 180.0), at(5.0, -180.0), 0.02, False),
        (at(0.0), at(0.0), 0.02, False),
    ],
)
def test_restarted(before: Mileage, after: Mileage, gap_s: float, anew: bool) -> None:
    assert restarted(before, after, gap_s, unbroken=False) is anew


@pytest.mark.parametrize(
    ("before", "after", "gap_s", "anew"),
    [
        (at(5.0), at(8.2), 4.0, False),
        (at(5.0), at(25.9), 4.0, False),
        (at(5.0), at(26.1), 4.0, True),
        (at(5.0, 0.0), at(5.0, 179.0), 4.0, False),
        (at(5.0, 0.0), at(5.0, 62.0), 0.02, False),
        (at(5.0, 0.0), at(5.0, 64.0), 0.02, True),
        (at(0.33), at(0.0), 60.0, True),
    ],
)
def test_counters_alone_that_were_silent_went_on_as_far_as_it_can_drive(
    before: Mileage, after: Mileage, gap_s: float, anew: bool
) -> None:
    assert restarted(before, after, gap_s, unbroken=True) is anew


@pytest.mark.parametrize(
    ("before", "after", "anew"),
    [
        (at(0.2), at(0.0), True),
        (at(0.3), at(0.1), True),
        (at(-0.3), at(-0.1), True),
        (at(0.3), at(-0.1), True),
        (at(0.171), at(0.0), True),
        (at(0.169), at(0.0), False),
        (at(0.06), at(0.03), False),  # it drove past the place where it was powered on
        (at(0.2), at(0.1), False),
        (at(0.0), at(0.1), False),  # farther from zero: it drove
        (at(0.4), at(0.154), True),
        (at(0.4), at(0.156), False),  # a board that came back cannot have counted so much
        (at(0.0, 14.0), at(0.0, 1.0), True),
        (at(0.0, -20.0), at(0.0, 7.0), True),
        (at(0.0, 12.7), at(0.0, 0.0), True),
        (at(0.0, 12.5), at(0.0, 0.0), False),
        (at(0.2, 24.0), at(0.1, 11.3), True),
        (at(0.2, 24.0), at(0.1, 11.5), False),
        (at(0.2, 24.0), at(0.1, 12.1), False),
        (at(0.0), at(0.0), False),
    ],
)
def test_after_a_silence_counters_that_are_nearer_to_zero_have_begun_anew(
    before: Mileage, after: Mileage, anew: bool
) -> None:
    assert restarted(before, after, 0.1, unbroken=True, silent=True) is anew
    assert not restarted(before, after, 0.15, unbroken=True)
