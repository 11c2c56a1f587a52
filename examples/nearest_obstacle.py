"""A consumer with T2's helpers: tells which obstacle is nearest.

python -m examples.nearest_obstacle
"""

import sys

from common import keys
from common.bus.bus import Arrival
from common.messages import SONAR_NAMES, Ultrasonic
from common.service import Node, run
from common.settings import Shared


def tell(arrival: Arrival[Ultrasonic]) -> None:
    """Print the nearest range, in metres, and which sonar has it."""
    named = zip(arrival.message.ranges, SONAR_NAMES, strict=True)
    seen = [(range_m, name) for range_m, name in named if range_m is not None]
    print("{:.2f} m {}".format(*min(seen)) if seen else "nothing near", flush=True)


def build(node: Node[Shared]) -> None:
    """Subscribe; the rest of a service's life comes with ``run``."""
    node.bus.subscribe(keys.ULTRASONIC, tell)


if __name__ == "__main__":
    sys.exit(run("nearest", Shared, build))
