"""Entry point of the recorder: ``python -m services.recorder``."""

import sys
from collections.abc import Callable, Sequence

from common.service import Node, run_optional_service
from services.recorder.config import RecorderConfig


def main(argv: Sequence[str] | None = None) -> int:
    """Record until SIGINT or SIGTERM; return the exit code."""
    return run_optional_service("recorder", RecorderConfig, _recorder, argv, extra="record")


def _recorder() -> Callable[[Node[RecorderConfig]], object]:
    from services.recorder.recorder import Recorder

    return Recorder


if __name__ == "__main__":
    sys.exit(main())
