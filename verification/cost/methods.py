"""Methods of counting: opcodes, callgrind and system calls.

Callgrind counts instructions and allocations, which do not depend on the load of the host.
"""

import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from verification.cost.ledger import UncountableError
from verification.cost.syscalls import system_calls

ROOT = Path(__file__).parents[2]
TOTAL = re.compile(r"^totals: (\d+)$", re.MULTILINE)
# A function is referenced by its number; its name is given at its first occurrence.
NAME = re.compile(r"^c?fn=\((\d+)\) (\S+)", re.MULTILINE)
CALLS = re.compile(r"^cfn=\((\d+)\).*\n(?:c\w+=.*\n)*?calls=(\d+) ", re.MULTILINE)
ALLOCATORS = {"_PyObject_Malloc", "_PyObject_Calloc", "_PyObject_Realloc"}  # of objects and buffers

Counted = dict[str, float]


def replayed(what: str, *tool: str) -> Counted:
    """Run ``verification.cost.replay`` in a clean process, under a tool; return its counts."""
    environ = {"PATH": os.environ["PATH"], "PYTHONPATH": str(ROOT), "PYTHONHASHSEED": "0"}
    command = [*tool, sys.executable, "-m", "verification.cost.replay", what]
    done = subprocess.run(
        command, cwd=ROOT, env=environ, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"the replay failed: {done.stderr}"
    counts: Counted = json.loads(done.stdout.splitlines()[-1])
    return counts


def under_callgrind() -> Mapping[str, Counted]:
    """Count instructions and allocations; raise ``UncountableError`` without valgrind."""
    if shutil.which("valgrind") is None:
        raise UncountableError("valgrind is not installed")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "callgrind"
        steps = replayed(
            "instructions",
            "valgrind",
            "--tool=callgrind",
            "--instr-atstart=no",  # the replay switches it on: imports would take most of the time
            "--dump-before=getpgrp",
            f"--callgrind-out-file={out}",
        )
        # A dump ends at each mark; every second dump also began at a mark.
        dumps = [Path(f"{out}.{2 * n}").read_text("utf-8") for n in range(1, len(steps) + 1)]
    if not allocations(dumps[0]):
        raise UncountableError(
            "this Python has no symbols, which callgrind needs to identify its allocator"
        )
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
    """Return the number of calls of Python's allocator."""
    ours = {number for number, name in NAME.findall(dump) if name in ALLOCATORS}
    return sum(int(times) for number, times in CALLS.findall(dump) if number in ours)


@dataclass(frozen=True, slots=True)
class Method:
    """One method of counting."""

    kinds: tuple[str, ...]  # of counts, as in counts.toml
    holds_for: Callable[[], str]  # environment for which the counts are valid
    count: Callable[[], Mapping[str, Counted]]  # by kind; raises ``UncountableError``


def python() -> str:
    """Return the interpreter."""
    return f"{platform.python_implementation()} {platform.python_version()}"


def build() -> str:
    """Return interpreter, compiler and architecture."""
    return ", ".join([python(), platform.python_compiler(), platform.machine()])


METHODS = (
    Method(("opcodes",), python, lambda: {"opcodes": replayed("opcodes")}),
    Method(("instructions", "allocations"), build, under_callgrind),
    Method(("syscalls",), platform.system, lambda: {"syscalls": system_calls()}),
)
