"""``python -m services.dashboard``: the robot in a browser."""

import sys

from services.dashboard.life import main

if __name__ == "__main__":
    sys.exit(main())
