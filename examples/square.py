"""Drive a square of 1 m by odometry, and print how far from its start the vehicle ends.

python square.py [tcp/127.0.0.1:7447]
"""

import math
import sys

import t2

SIDE = 1.0  # m


def square(endpoint: str) -> None:
    """Drive four sides and turns as the source ``nav``."""
    with t2.connect("001", endpoint=endpoint) as robot:
        start = robot.odometry.latest(timeout=5)
        with robot.drive("nav") as drive:
            for _ in range(4):
                drive.forward(SIDE, speed=0.4, on_stop="wait")
                drive.turn(math.pi / 2, on_stop="wait")
        end = robot.odometry.latest()
        print(f"{math.dist((start.x, start.y), (end.x, end.y)):.2f} m from the start")


if __name__ == "__main__":
    try:
        square("".join(sys.argv[1:]))
    except t2.Latched as stop:
        sys.exit(f"Stopped: {stop} Causes: {', '.join(cause.name for cause in stop.causes)}")
    except t2.T2Error as error:
        sys.exit(str(error))
