"""The safety service: settings to ports to loop."""

import sys
from collections.abc import Sequence

from common import realtime
from common.bus.bus import Bus
from common.service import Node, run
from services.safety.config import SafetyConfig
from services.safety.service import Ports


def main(argv: Sequence[str] | None = None) -> int:
    """Live until SIGINT or SIGTERM, and return the exit code."""
    readers: list[Bus] = []

    def build(node: Node[SafetyConfig]) -> None:
        # The emergency stop has a session of its own: telemetry must never be ahead of it.
        reader = node.open_bus()
        readers.append(reader)
        Ports(node, reader)
        reader.open()
        accepted = node.config.safety.unsafe_overrides
        if accepted:
            node.log.warning("protections taken away on purpose", settings=list(accepted))

    try:
        return run("safety", SafetyConfig, build, argv, priority=realtime.SAFETY)
    finally:
        for reader in readers:
            reader.close()


if __name__ == "__main__":
    sys.exit(main())
