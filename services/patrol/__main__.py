"""``python -m services.patrol``: taught routes, rounds and their schedule."""

import sys

from common.service import run
from services.patrol.config import PatrolConfig
from services.patrol.patrol import PatrolService

if __name__ == "__main__":
    sys.exit(run("patrol", PatrolConfig, PatrolService))
