"""What a round decides on: the newest state of safety, and the newest pose in the map."""

import math

from msgspec import Struct

from common.freshness import NS_PER_S, Latest
from common.pose import Covariance, Pose
from t2 import messages as m
from t2.messages import Phrase

SILENT_S = 2.0  # of a program: it does not run any more
CHANGED_M, CHANGED_RAD = 0.1, 0.1  # of a pose


class Inputs(Struct):
    """The newest messages."""

    safety: Latest[m.SafetyState] | None = None
    pose: Latest[m.MapPose] | None = None
    other_ns: int | None = None  # when another patrol service published its state

    def twice(self, now_ns: int) -> Phrase | None:
        """Return the reason while another patrol service runs for this robot."""
        is_alive = self.other_ns is not None and now_ns - self.other_ns <= SILENT_S * NS_PER_S
        return Phrase("patrol.twice") if is_alive else None


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
