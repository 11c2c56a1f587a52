"""The proof of localization, on two vehicles."""

import pytest

from verification.localization.run import measure


@pytest.mark.parametrize("seed", [2, 5])
def test_a_pose_is_as_good_as_it_says(seed: int) -> None:
    found = measure(seed)
    assert found.placed == 1.0
    assert found.used > 25
    assert found.error < 1.0
    assert sum(found.nees) / len(found.nees) < 5.0
