"""``python -m bench.no_reflex``: the bridge without its reflex.

It publishes a hit, and sends BRAKE when safety's motion commands it. Nothing else differs.
"""

import sys
from unittest.mock import patch

from common import realtime
from common.service import run
from services.bridge.bridge import Bridge
from services.bridge.config import BridgeConfig
from services.bridge.core import Core
from services.bridge.motion_output import MotionOutput
from services.bridge.output import Output

take = Core.datagram


def main() -> int:
    """Run the bridge; return the exit code."""
    with (
        patch.multiple(Core, reflex=lambda *_: None, datagram=unbraked),
        patch.object(MotionOutput, "on_hit", lambda *_: None),
    ):
        return run("bridge", BridgeConfig, Bridge, priority=realtime.BRIDGE)


def unbraked(core: Core, datagram: bytes, port: int, now_ns: int, *, reported: bool) -> Output:
    """Process a datagram, and send no BRAKE for it."""
    out = take(core, datagram, port, now_ns, reported=False)
    out.sends.clear()
    return out


if __name__ == "__main__":
    sys.exit(main())
