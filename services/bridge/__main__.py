"""``python -m services.bridge``: the board's frames to messages, safety's motion to frames."""

import sys

from common.service import run
from services.bridge.bridge import Bridge
from services.bridge.config import BridgeConfig


def main() -> int:
    """Run the bridge until it is told to stop."""
    return run("bridge", BridgeConfig, Bridge)


if __name__ == "__main__":
    sys.exit(main())
