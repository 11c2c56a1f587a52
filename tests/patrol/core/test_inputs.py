"""What a round knows of the vehicle: whether its pose has changed, and is known."""

import pytest

from common.pose import Pose
from services.patrol.core.inputs import Inputs, has_changed, is_known, lost
from t2 import messages as m
from t2.messages import Phrase
from tests.factories import map_pose


@pytest.mark.parametrize(
    ("before", "now", "changed"),
    [
        (Pose(0.0, 0.0, 0.0), Pose(0.1, 0.0, 0.1), False),
        (Pose(0.0, 0.0, 0.0), Pose(0.0, -0.11, 0.0), True),
        (Pose(0.0, 0.0, 0.0), Pose(0.0, 0.0, -0.11), True),
        (Pose(5.0, 5.0, 1.0), Pose(5.0, 5.0, 1.0), False),
        (Pose(0.0, 0.0, 3.1), Pose(0.0, 0.0, -3.1), False),  # 0.08 rad over the rear
    ],
)
def test_a_pose_has_changed_by_ten_centimetres_or_a_tenth_of_a_radian(
    before: Pose, now: Pose, changed: bool
) -> None:
    assert has_changed(before, now) == changed


@pytest.mark.parametrize(
    ("pose", "known"),
    [
        (map_pose(), True),
        (map_pose("lost"), False),
        (map_pose(x=None), False),
        (map_pose(pose_covariance=None), False),
    ],
)
def test_a_pose_is_known_that_is_placed_and_complete(pose: m.MapPose, known: bool) -> None:
    assert is_known(pose) == known


@pytest.mark.parametrize(
    ("phrases", "reason"),
    [
        ((Phrase("map.unplaced"), Phrase("map.uncertain")), "map.unplaced"),
        ((), "teach.lost"),
    ],
)
def test_a_lost_position_has_the_first_reason_of_localization(
    phrases: m.Phrases, reason: str
) -> None:
    assert lost(map_pose("lost", phrases=phrases)) == Phrase(reason)


@pytest.mark.parametrize(
    ("other_ns", "reason"),
    [(None, None), (0, Phrase("patrol.twice")), (-1, None)],
)
def test_another_patrol_runs_for_two_seconds_after_its_state(
    other_ns: int | None, reason: Phrase | None
) -> None:
    assert Inputs(other_ns=other_ns).twice(2_000_000_000) == reason
