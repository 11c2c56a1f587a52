"""Locate the vehicle by tags on the walls, as the source of fixes "tags".

detector | python localizer.py [tcp/127.0.0.1:7447], with [localization.sources] tags in the
settings. The detector prints a line for each tag in a picture, x and y in m and heading in rad as
seen from the vehicle, and the age of the picture in s:
{"tag": "7", "x": 1.8, "y": -0.4, "heading": 3.0, "age": 0.12}
"""

import json
import math
import sys
import time
from collections import deque
from contextlib import suppress

import t2
from t2.messages import Odometry

TAGS = {"7": (4.0, 1.0, math.pi), "8": (0.0, 3.0, -math.pi / 2)}  # x, y, heading in the map
SIGMA, BY_DISTANCE, TURN_SIGMA = 0.02, 0.02, 0.03  # m, m per m, rad: of a detection

received = deque[tuple[float, Odometry]](maxlen=100)  # 4 s, with the local time


def locate(tag: str, x: float, y: float, heading: float) -> tuple[float, float, float]:
    """Return the vehicle's pose in the map, from a tag at a pose seen from the vehicle."""
    tag_x, tag_y, tag_heading = TAGS[tag]
    turn = tag_heading - heading  # of the vehicle in the map
    cos, sin = math.cos(turn), math.sin(turn)
    pose = tag_x - cos * x + sin * y, tag_y - sin * x - cos * y
    return *pose, math.remainder(turn, math.tau)


def main(endpoint: str) -> None:
    """Send a fix for each known tag; localization refuses what is late, repeated or far off."""
    with t2.connect("001", endpoint=endpoint) as robot:
        robot.odometry.on(lambda pose: received.append((time.monotonic(), pose)))
        for line in sys.stdin:
            seen = json.loads(line)
            taken_s = time.monotonic() - seen["age"]
            poses = [pose for at_s, pose in list(received) if at_s <= taken_s]
            if seen["tag"] not in TAGS or not poses:
                continue
            x, y = seen["x"], seen["y"]
            # The error of the heading moves the vehicle, too.
            place = SIGMA + (BY_DISTANCE + TURN_SIGMA) * math.hypot(x, y)
            covariance = (place**2, 0, 0, 0, place**2, 0, 0, 0, TURN_SIGMA**2)
            pose = locate(seen["tag"], x, y, seen["heading"])
            with suppress(t2.NoData):  # while localization restarts
                robot.fix("tags", *pose, covariance, odometry=poses[-1])


if __name__ == "__main__":
    main("".join(sys.argv[1:]))
