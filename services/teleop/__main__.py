"""``python -m services.teleop``: drive from this terminal."""

import sys

from services.teleop.life import main

if __name__ == "__main__":
    sys.exit(main())
