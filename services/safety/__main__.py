"""Entry point of the safety service."""

import sys
from collections.abc import Sequence

from common import realtime
from common.service import Node, run
from services.safety.config import SafetyConfig
from services.safety.service import SafetyService


def build(node: Node[SafetyConfig]) -> None:
    """Build the service."""
    # The emergency stop has its own session, so telemetry cannot delay it.
    SafetyService(node, node.open_bus())
    accepted = node.config.unsafe_overrides
    if accepted:
        node.log.warning("unsafe overrides are active", settings=list(accepted))


def main(argv: Sequence[str] | None = None) -> int:
    """Run until SIGINT or SIGTERM, and return the exit code."""
    return run("safety", SafetyConfig, build, argv, priority=realtime.SAFETY)


if __name__ == "__main__":
    sys.exit(main())
