"""A speed limit with T2's packages: slow down while the front sonars see something near.

python -m examples.limit_speed, with [safety.limits.lidar] in safety's settings
"""

import math
import sys

from common import keys
from common.bus.bus import Arrival
from common.messages import Ultrasonic
from common.service import Node, run
from common.settings import Shared
from common.source import LimitPublisher


def front(sonars: Ultrasonic) -> float:
    """Return the distance to the nearest obstacle; a sonar that cannot measure counts as 0."""
    measured = zip(sonars.ranges[1:4], sonars.status[1:4], strict=True)
    return min({"ok": r or 0.0, "no_echo": math.inf}.get(s, 0.0) for r, s in measured)


def build(node: Node[Shared]) -> None:
    """Publish a limit for each sonar sample, 20 times a second."""
    limits = LimitPublisher(node.bus, "lidar")

    def limit(arrival: Arrival[Ultrasonic]) -> None:
        near = front(arrival.message)
        limits.limit(linear=0.2 if near < 1.0 else None, reason=f"something at {near:.2f} m")

    node.bus.subscribe(keys.ULTRASONIC, limit)


if __name__ == "__main__":
    sys.exit(run("limit", Shared, build))
