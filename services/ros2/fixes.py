"""Poses that ROS nodes measure, as fixes of localization. Pure.

A fix names the odometry that was newest when it was measured; a ROS pose has a stamp. So the stamp
is compared with those of the odometry that the gateway has published, as tf2 compares it with
transforms. That needs clocks that agree: one that is ahead is refused, one that is up to 2 s behind
is not noticed, and shifts the pose along the path.
"""

import math
from collections import deque

from common.freshness import NS_PER_S, Latest
from common.text import printable
from services.ros2.cdr import Value
from t2.messages import MAX_NUMBER, Field, Fix, Odometry, Phrase

POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
MAP = "map"  # frame of the poses; robots with prefixes of their own share it
KEPT_NS = 2 * NS_PER_S  # as localization keeps odometry
GAP_NS = NS_PER_S // 10  # from odometry to the stamp, at most: 2.5 periods
UNIT = 0.01  # of a quaternion's squared length, as in tf2
TILT = 0.3  # rad, roll and pitch of a vehicle on a floor
UNKNOWN_YAW = (2 * math.pi) ** 2  # variance, rad^2: from a whole turn on there is no heading
PLANE = (0, 1, 5)  # x, y, yaw of the six axes of a covariance
MAX_FRAME = 60  # characters of a refused frame that are shown


class PublishedOdometry:
    """Odometry that the gateway published in the last 2 s; times are of our monotonic clock."""

    def __init__(self) -> None:
        self._kept: deque[Latest[Odometry]] = deque()

    def note(self, message: Odometry, now_ns: int) -> None:
        """Keep a message that was published now."""
        if self._kept and message.t_ns <= self._kept[-1].value.t_ns:
            self._kept.clear()  # the robot's wall clock was set back: stamps are ambiguous
        self._kept.append(Latest(message, now_ns))
        self._forget(now_ns)

    def find(self, boot: int, seq: int) -> Odometry | None:
        """Return a message by its header."""
        kept = (each.value for each in reversed(self._kept))
        return next((each for each in kept if (each.boot, each.seq) == (boot, seq)), None)

    def at(self, stamp_ns: int, now_ns: int) -> Odometry | Phrase:
        """Return the newest message at a stamp, or why there is none."""
        self._forget(now_ns)
        if not self._kept:
            return Phrase("ros_fix.no_odometry")
        ages = ((stamp_ns - each.value.t_ns, each.value) for each in reversed(self._kept))
        age_ns, message = next((each for each in ages if each[0] >= 0), (GAP_NS + 1, None))
        if message is None or age_ns > GAP_NS:
            older_s = (self._kept[-1].value.t_ns - stamp_ns) / NS_PER_S
            seconds = max(-MAX_NUMBER, min(MAX_NUMBER, older_s))
            return Phrase("ros_fix.clock", {"seconds": seconds})
        return message

    def _forget(self, now_ns: int) -> None:
        while self._kept and now_ns - self._kept[0].received_ns > KEPT_NS:
            self._kept.popleft()


def fix(message: Value, published: PublishedOdometry, now_ns: int) -> Fix | Phrase:
    """Return the fix of a PoseWithCovarianceStamped, or why it is refused."""
    ((seconds, nanoseconds), frame), (((x, y, z), turned), spread) = message
    if frame != MAP:
        fields: dict[str, Field] = {"frame": printable(frame[:MAX_FRAME]), "map": MAP}
        return Phrase("ros_fix.frame", fields)
    if not all(map(math.isfinite, (x, y, z, *turned, *spread))):
        return Phrase("ros_fix.not_finite")
    heading = heading_of(turned)
    if heading is None:
        return Phrase("ros_fix.orientation")
    is_turn_known = spread[35] < UNKNOWN_YAW
    covariance = covariance_of(spread, PLANE if is_turn_known else PLANE[:2])
    if not all(abs(number) <= MAX_NUMBER for number in (x, y, *covariance)):
        return Phrase("ros_fix.not_finite")
    odometry = published.at(seconds * NS_PER_S + nanoseconds, now_ns)
    if isinstance(odometry, Phrase):
        return odometry
    return Fix(
        x=x,
        y=y,
        heading=heading if is_turn_known else None,
        covariance=covariance,
        odom_boot=odometry.boot,
        odom_seq=odometry.seq,
    )


def heading_of(turned: Value) -> float | None:
    """Return the yaw (rad) of a quaternion; None if it is no rotation, or no vehicle's."""
    x, y, z, w = turned
    square = x * x + y * y + z * z + w * w
    if not abs(square - 1.0) <= UNIT:
        return None
    roll = math.atan2(2 * (w * x + y * z), w * w - x * x - y * y + z * z)
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x) / square)))
    if max(abs(roll), abs(pitch)) > TILT:
        return None
    return math.atan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)


def covariance_of(spread: Value, axes: tuple[int, ...]) -> tuple[float, ...]:
    """Return the 3x3 covariance over x, y, heading of a 6x6 one; zero besides these axes."""
    return tuple(
        spread[6 * row + column] if row in axes and column in axes else 0.0
        for row in PLANE
        for column in PLANE
    )
