"""``python -m bench.reaction.blunt``: the bridge without its reflex, for what safety's word takes.

Nothing else differs: a hit is published, and BREAK is sent when safety's motion says so.
"""

import sys
from unittest.mock import patch

from common import realtime
from common.service import run
from services.bridge.bridge import Bridge
from services.bridge.config import BridgeConfig
from services.bridge.wheels import Wheels


def main() -> int:
    """Bridge until it is told to stop; return the exit code."""
    with patch.multiple(Wheels, brake=lambda _: 0, on_hit=lambda *_: None):
        return run("bridge", BridgeConfig, Bridge, priority=realtime.BRIDGE)


if __name__ == "__main__":
    sys.exit(main())
