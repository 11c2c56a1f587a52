"""Follow the wall on the right at 0.8 m, and turn left before the next one, until Ctrl-C.

python wall_follower.py [tcp/127.0.0.1:7447]
"""

import math
import sys

import t2
from t2.messages import SONAR_NAMES, Ultrasonic

DISTANCE, TURN_AT = 0.8, 1.2  # m, to the walls on the right and ahead
SPEED, GAIN, DAMPING, MAX_TURN = 0.25, 0.6, 25.0, 0.4  # m/s, rad/(s m), rad/(s m), rad/s
FRONT, RIGHT = SONAR_NAMES.index("front"), SONAR_NAMES.index("right")


def distance(sample: Ultrasonic, sonar: int) -> float:
    """Return what a sonar measures, in m; one that cannot measure counts as 0."""
    measured = {"ok": sample.ranges[sonar] or 0.0, "no_echo": math.inf}
    return measured.get(sample.status[sonar], 0.0)


def follow(endpoint: str) -> None:
    """Drive as the source ``nav``, steered by the wall's smoothed distance and its change."""
    with t2.connect("001", endpoint=endpoint) as robot, robot.drive("nav") as drive:
        wall = DISTANCE
        for sample in robot.ultrasonic:
            if distance(sample, FRONT) < TURN_AT:
                drive.turn(math.pi / 2)
                wall = DISTANCE
                continue
            change = min(distance(sample, RIGHT), 2 * DISTANCE) - wall
            wall += 0.3 * change
            steer = GAIN * (DISTANCE - wall) - DAMPING * change
            drive.velocity(SPEED, max(-MAX_TURN, min(MAX_TURN, steer)), seconds=0.5)


if __name__ == "__main__":
    try:
        follow("".join(sys.argv[1:]))
    except KeyboardInterrupt:
        pass
    except t2.T2Error as error:
        sys.exit(str(error))
