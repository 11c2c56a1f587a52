"""The proof of localization, on one vehicle whose board loses its counters."""

from statistics import fmean

import pytest

from verification.localization.run import measure

pytestmark = pytest.mark.simulated


def test_a_pose_is_as_good_as_it_says() -> None:
    found = measure(6, seconds=50.0)
    assert found.mute
    assert found.placed == 1.0
    assert found.used > 10
    assert found.error < 0.5
    assert fmean(found.nees) < 4.0
