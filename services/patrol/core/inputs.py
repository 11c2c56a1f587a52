"""What a round decides on: the newest state of safety, and the newest pose in the map."""

import math

from msgspec import Struct

from common.freshness import Latest
from common.pose import Covariance, Pose
from t2 import messages as m
from t2.messages import Phrase

CHANGED_M, CHANGED_RAD = 0.1, 0.1  # of a pose


class Inputs(Struct):
    """The newest messages."""

    safety: Latest[m.SafetyState] | None = None
    pose: Latest[m.MapPose] | None = None


def has_changed(before: Pose, now: Pose) -> bool:
    """Return whether the vehicle is at another place than before."""
    turn = abs(math.remainder(now.heading - before.heading, math.tau))
    return math.dist((before.x, before.y), (now.x, now.y)) > CHANGED_M or turn > CHANGED_RAD


def is_known(pose: m.MapPose) -> bool:
    """Return whether a pose in the map is complete, and certain enough for localization."""
    parts = pose.x, pose.y, pose.heading, pose.pose_covariance
    return pose.state == "placed" and None not in parts


def lost(pose: m.MapPose) -> Phrase:
    """Return why a pose is not known."""
    return pose.phrases[0] if pose.phrases else Phrase("teach.lost")


def located_of(pose: m.MapPose) -> tuple[Pose, Covariance]:
    """Return the pose in the map; only while it is known."""
    assert pose.x is not None
    assert pose.y is not None
    assert pose.heading is not None
    assert pose.pose_covariance is not None
    return Pose(pose.x, pose.y, pose.heading), Covariance.of(pose.pose_covariance)
