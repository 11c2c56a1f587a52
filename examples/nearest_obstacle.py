"""A consumer with T2's packages: print the nearest obstacle.

python -m examples.nearest_obstacle
"""

import sys

from common import keys
from common.bus.bus import Arrival
from common.messages import SONAR_NAMES, Ultrasonic
from common.service import Node, run
from common.settings import Shared


def print_nearest(arrival: Arrival[Ultrasonic]) -> None:
    """Print the shortest range, in metres, and its sonar."""
    named = zip(arrival.message.ranges, SONAR_NAMES, strict=True)
    measured = [(range_m, name) for range_m, name in named if range_m is not None]
    print("{:.2f} m {}".format(*min(measured)) if measured else "nothing near", flush=True)


def build(node: Node[Shared]) -> None:
    """Subscribe; ``run`` does the rest."""
    node.bus.subscribe(keys.ULTRASONIC, print_nearest)


if __name__ == "__main__":
    sys.exit(run("nearest", Shared, build))
