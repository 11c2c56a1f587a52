"""``python -m verification.cost.replay WHAT``: run each hot path and count.

``opcodes``       Python opcodes per step, without the replay itself
``instructions``  nothing itself: callgrind counts between two calls of ``getpgrp``

The result is JSON: the counts, or the number of steps of each path for ``instructions``.
"""

import gc
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

from verification.cost.paths import HotPath, hot_paths

HERE = str(Path(__file__).parent)
WARM = 1  # uncounted steps to warm up caches and free lists


def main() -> int:
    """Run the chosen counter."""
    count = COUNTERS[sys.argv[1]]
    gc.disable()  # its runs depend on earlier allocations
    paths = hot_paths()
    for path in paths:
        path.clock.install()
        for _ in range(WARM):
            path.step()
            path.restore()
    if sys.argv[1] == "instructions":
        begin_instructions()
    counts = {}
    for path in paths:
        path.clock.install()
        counts[path.name] = count(path)
    print(json.dumps(counts))
    return 0


def opcodes(path: HotPath) -> float:
    """Return the opcodes of a step."""
    count = 0

    def on_event(_: FrameType, event: str, __: Any) -> Any:
        nonlocal count
        count += event == "opcode"
        return on_event

    def on_call(frame: FrameType, _: str, __: Any) -> Any:
        if frame.f_code.co_filename.startswith(HERE):
            return None
        frame.f_trace_opcodes, frame.f_trace_lines = True, False
        return on_event

    for _ in range(path.times):
        sys.settrace(on_call)
        path.step()
        sys.settrace(None)
        path.restore()
    return count / path.times


def begin_instructions() -> None:
    """Switch callgrind's instrumentation on."""
    # Containers may forbid ptrace; a busy process polls for the command.
    me = [f"--pid={os.getpid()}", "--max-invoke-ms=0"]
    with subprocess.Popen(["vgdb", *me, "instrumentation", "on"], stdout=sys.stderr) as vgdb:
        while vgdb.poll() is None:
            pass


def instructions(path: HotPath) -> int:
    """Run the steps between two marks for callgrind; return their number."""
    os.getpgrp()
    for _ in range(path.times):
        path.step()
        path.restore()
    os.getpgrp()
    return path.times


COUNTERS: dict[str, Callable[[HotPath], float]] = {
    "opcodes": opcodes,
    "instructions": instructions,
}

if __name__ == "__main__":
    sys.exit(main())
