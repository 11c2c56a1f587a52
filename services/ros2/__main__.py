"""Entry point of the gateway to ROS 2: ``python -m services.ros2``."""

import sys
from collections.abc import Callable, Sequence

from common.service import Node, run_optional_service
from services.ros2.config import Ros2Config


def main(argv: Sequence[str] | None = None) -> int:
    """Run until SIGINT or SIGTERM; return the exit code."""
    return run_optional_service("ros2", Ros2Config, _gateway, argv, extra="ros2")


def _gateway() -> Callable[[Node[Ros2Config]], object]:
    from services.ros2.gateway import Gateway

    return Gateway


if __name__ == "__main__":
    sys.exit(main())
