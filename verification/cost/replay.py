"""``python -m verification.cost.replay WHAT``: walk each hot path, and count in this process.

``opcodes``       Python instructions of everything but the replay itself, per step
``instructions``  counts nothing: callgrind does, from one ``getpgrp`` to the next

The first are printed as JSON; the last prints the names and numbers of its steps.
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

from verification.cost.paths import Walk, walks

HERE = str(Path(__file__).parent)
WARM = 1  # steps before the first that counts: caches, free lists


def main() -> int:
    """Count what is asked for."""
    count = COUNTERS[sys.argv[1]]
    gc.disable()  # when it runs depends on what was made before
    all_walks = walks()
    for walk in all_walks:
        walk.clock.install()
        for _ in range(WARM):
            walk.step()
            walk.mend()
    if sys.argv[1] == "instructions":
        begin_instructions()
    told = {}
    for walk in all_walks:
        walk.clock.install()
        told[walk.name] = count(walk)
    print(json.dumps(told))
    return 0


def opcodes(walk: Walk) -> float:
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

    for _ in range(walk.times):
        sys.settrace(on_call)
        walk.step()
        sys.settrace(None)
        walk.mend()
    return count / walk.times


def begin_instructions() -> None:
    """Have callgrind, which has only run this process so far, take note from here on."""
    # Without the ptrace that a container may forbid: a busy process listens by itself.
    me = [f"--pid={os.getpid()}", "--max-invoke-ms=0"]
    with subprocess.Popen(["vgdb", *me, "instrumentation", "on"], stdout=sys.stderr) as vgdb:
        while vgdb.poll() is None:
            pass


def instructions(walk: Walk) -> int:
    """Walk between two marks for callgrind; return how many steps."""
    os.getpgrp()
    for _ in range(walk.times):
        walk.step()
        walk.mend()
    os.getpgrp()
    return walk.times


COUNTERS: dict[str, Callable[[Walk], float]] = {
    "opcodes": opcodes,
    "instructions": instructions,
}

if __name__ == "__main__":
    sys.exit(main())
