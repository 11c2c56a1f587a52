"""``python -m bench.no_reflex``: the bridge without its reflex.

It publishes a hit, and sends BRAKE when safety's motion commands it. Nothing else differs.
"""

import sys
from unittest.mock import patch

from common import realtime
from common.service import run
from services.bridge.bridge import Bridge
from services.bridge.config import BridgeConfig
from services.bridge.core.motion_output import MotionOutput

if __name__ == "__main__":
    with patch.multiple(MotionOutput, reflex=lambda *_: (), on_hit=lambda *_: ()):
        sys.exit(run("bridge", BridgeConfig, Bridge, priority=realtime.BRIDGE))
