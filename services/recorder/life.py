"""The recorder's beginning: what it needs is an extra, and it stands behind all others."""

import os
import sys
from collections.abc import Sequence

from common.options import EXIT_CONFIG
from common.service import run
from services.recorder.config import RecorderConfig

NICE = 10  # whatever drives goes first
MISSING = "recordings need {}: install the extra `record` (pip install -e '.[record]')"


def main(argv: Sequence[str] | None = None) -> int:
    """Record until it is told to stop; return the exit code."""
    try:
        from services.recorder.recorder import Recorder
    except ModuleNotFoundError as error:
        print(f"recorder: {MISSING.format(error.name)}", file=sys.stderr)  # noqa: T201
        return EXIT_CONFIG
    os.nice(NICE)
    return run("recorder", RecorderConfig, Recorder, argv)
