"""Instructions and allocations of each step, by callgrind: the same however busy the machine is."""

import re
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path

from verification.cost.process import Counts, replayed
from verification.cost.uncountable import Uncountable

TOTAL = re.compile(r"^totals: (\d+)$", re.MULTILINE)
# A function is called by its number; its name stands where it is met first.
NAME = re.compile(r"^c?fn=\((\d+)\) (\S+)", re.MULTILINE)
CALLS = re.compile(r"^cfn=\((\d+)\).*\n(?:c\w+=.*\n)*?calls=(\d+) ", re.MULTILINE)
ALLOCATORS = {"_PyObject_Malloc", "_PyObject_Calloc", "_PyObject_Realloc"}  # of objects and buffers


def under_callgrind() -> Mapping[str, Counts]:
    """Return instructions and allocations; raise ``Uncountable`` without valgrind."""
    if shutil.which("valgrind") is None:
        raise Uncountable("valgrind is not installed")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "callgrind"
        steps = replayed(
            "instructions",
            "valgrind",
            "--tool=callgrind",
            "--instr-atstart=no",  # the replay says when: imports would take most of the time
            "--dump-before=getpgrp",
            f"--callgrind-out-file={out}",
        )
        # A dump ends at each mark; every second one began at a mark, too.
        dumps = [Path(f"{out}.{2 * n}").read_text("utf-8") for n in range(1, len(steps) + 1)]
    if not allocations(dumps[0]):
        raise Uncountable("this Python has no symbols, by which callgrind knows its allocator")
    pairs = list(zip(steps.items(), dumps, strict=True))
    return {
        "instructions": {name: round(total(dump) / times) for (name, times), dump in pairs},
        "allocations": {name: allocations(dump) / times for (name, times), dump in pairs},
    }


def total(dump: str) -> int:
    """Return the instructions in a dump."""
    found = TOTAL.search(dump)
    assert found is not None, "callgrind's dump has no totals"
    return int(found[1])


def allocations(dump: str) -> int:
    """Return how often Python's allocator was asked for memory."""
    ours = {number for number, name in NAME.findall(dump) if name in ALLOCATORS}
    return sum(int(times) for number, times in CALLS.findall(dump) if number in ours)
