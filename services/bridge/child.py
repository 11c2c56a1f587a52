"""``python -m services.bridge.child``: the bridge process, started by ``services.bridge.guard``."""

import os
import signal
import sys

from common import realtime
from common.service import run
from services.bridge.bridge import Bridge
from services.bridge.config import BridgeConfig
from services.bridge.guard_ipc import NAME, received


def main() -> int:
    """Run the bridge until a signal, or until its guard has died."""
    if NAME not in os.environ:
        print("bridge: start it by `python -m services.bridge`", file=sys.stderr)  # noqa: T201
        return 2
    # systemd sends these to guard and bridge alike; the guard passes them on.
    for number in (signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)
    inherited = received(os.environ)
    # The guard needs the higher priority: it brakes for this process.
    ahead = realtime.BRIDGE if realtime.priority(os.getppid()) > realtime.BRIDGE else 0
    return run("bridge", BridgeConfig, lambda node: Bridge(node, inherited), priority=ahead)


if __name__ == "__main__":
    sys.exit(main())
