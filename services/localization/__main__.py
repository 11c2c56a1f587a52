"""``python -m services.localization``: odometry and fixes to the pose in the map."""

import sys

from common.service import run
from services.localization.config import LocalizationConfig
from services.localization.localization import LocalizationService

if __name__ == "__main__":
    sys.exit(run("localization", LocalizationConfig, LocalizationService))
