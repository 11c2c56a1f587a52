"""Entry point of the safety service."""

import sys
from collections.abc import Sequence

from common import realtime
from common.bus.bus import Bus
from common.service import Node, run
from services.safety.config import SafetyConfig
from services.safety.service import SafetyService


def main(argv: Sequence[str] | None = None) -> int:
    """Run until SIGINT or SIGTERM, and return the exit code."""
    estop_buses: list[Bus] = []

    def build(node: Node[SafetyConfig]) -> None:
        # The emergency stop has its own session, so telemetry cannot delay it.
        estop_bus = node.open_bus()
        estop_buses.append(estop_bus)
        SafetyService(node, estop_bus)
        estop_bus.open()
        accepted = node.config.safety.unsafe_overrides
        if accepted:
            node.log.warning("unsafe overrides are active", settings=list(accepted))

    try:
        return run(
            "safety",
            SafetyConfig,
            build,
            argv,
            priority=realtime.SAFETY,
            in_place=True,
            links=3,  # two to the router, one to the bridge
        )
    finally:
        for estop_bus in estop_buses:
            estop_bus.close()


if __name__ == "__main__":
    sys.exit(main())
