"""A consumer with T2's packages: print the nearest obstacle.

python -m examples.nearest_obstacle
"""

import math
import sys

from common import keys
from common.bus.bus import Arrival
from common.messages import SONAR_NAMES, Ultrasonic
from common.service import Node, run
from common.settings import Shared


def print_nearest(arrival: Arrival[Ultrasonic]) -> None:
    """Print the shortest range, in m, and its sonar; one that cannot measure counts as 0."""
    named = zip(arrival.message.ranges, arrival.message.status, SONAR_NAMES, strict=True)
    near, name = min(({"ok": r or 0.0, "no_echo": math.inf}.get(s, 0.0), n) for r, s, n in named)
    print(f"{near:.2f} m {name}" if near < math.inf else "nothing near", flush=True)


def build(node: Node[Shared]) -> None:
    """Subscribe; ``run`` does the rest."""
    node.bus.subscribe(keys.ULTRASONIC, print_nearest)


if __name__ == "__main__":
    sys.exit(run("nearest", Shared, build))
