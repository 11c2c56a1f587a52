"""Print the pose and the nearest obstacle, twice a second.

python nearest_obstacle.py [tcp/127.0.0.1:7447]
"""

import math
import signal
import sys
import time

import t2


def nearest(sonars: t2.messages.Ultrasonic) -> float:
    """Return the distance to the nearest obstacle; a sonar that cannot measure counts as 0."""
    measured = zip(sonars.ranges, sonars.status, strict=True)
    return min({"ok": r or 0.0, "no_echo": math.inf}.get(s, 0.0) for r, s in measured)


def main(endpoint: str) -> None:
    """Print until Ctrl-C, or until no data arrives: ``t2.NoData``."""
    with t2.connect("001", endpoint=endpoint) as robot:
        while True:
            pose, sonars = robot.odometry.latest(), robot.ultrasonic.latest()
            print(
                f"x {pose.x:.2f} m  y {pose.y:.2f} m"
                f"  heading {pose.heading:.2f} rad  nearest {nearest(sonars):.2f} m",
                flush=True,
            )
            time.sleep(0.5)


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends it without a traceback
    main("".join(sys.argv[1:]))
