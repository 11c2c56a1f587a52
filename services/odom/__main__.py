"""``python -m services.odom``: the board's counters and velocities to pose and twist."""

import sys

from common.service import run
from services.odom.config import OdomConfig
from services.odom.odometer import Odometer

if __name__ == "__main__":
    sys.exit(run("odom", OdomConfig, Odometer))
