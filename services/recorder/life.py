"""The recorder's beginning: what it needs is an extra, and it stands behind all others."""

from collections.abc import Callable, Sequence

from common.service import Node, run_optional_service
from services.recorder.config import RecorderConfig


def main(argv: Sequence[str] | None = None) -> int:
    """Record until it is told to stop; return the exit code."""
    return run_optional_service("recorder", RecorderConfig, _recorder, argv, extra="record")


def _recorder() -> Callable[[Node[RecorderConfig]], object]:
    from services.recorder.recorder import Recorder

    return Recorder
