"""The kinds of counts, what they hold for, and how each is made: in a process of its own."""

import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.cost.syscalls import system_calls
from tests.cost.uncountable import Uncountable

ROOT = Path(__file__).parents[2]
TOTAL = re.compile(r"^totals: (\d+)$", re.MULTILINE)
Counts = dict[str, float]


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of count."""

    name: str
    unit: str
    holds_for: Callable[[], str]  # what else must be the same for counts to be the same
    count: Callable[[], Counts]  # raises ``Uncountable``


def python() -> str:
    """Name the interpreter whose opcodes and objects are counted."""
    return f"{platform.python_implementation()} {platform.python_version()}"


def build() -> str:
    """Name the interpreter as it was compiled, and for what."""
    return ", ".join([python(), platform.python_compiler(), platform.machine()])


def replayed(what: str, *before: str) -> Counts:
    """Return what the replay prints, in a process that nothing from outside gets into."""
    environ = {"PATH": os.environ["PATH"], "PYTHONPATH": str(ROOT), "PYTHONHASHSEED": "0"}
    command = [*before, sys.executable, "-m", "tests.cost.replay", what]
    done = subprocess.run(command, env=environ, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise AssertionError(f"the replay failed: {done.stderr}")
    counts: Counts = json.loads(done.stdout.splitlines()[-1])
    return counts


def instructions() -> Counts:
    """Return the machine's instructions of each step, by callgrind."""
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
        # One dump ends at each mark; every second one began at a mark, too.
        totals = [total_in(Path(f"{out}.{2 * n}")) for n in range(1, len(steps) + 1)]
    pairs = zip(steps.items(), totals, strict=True)
    return {name: round(total / times) for (name, times), total in pairs}


def total_in(dump: Path) -> int:
    """Return the instructions in a dump of callgrind's."""
    found = TOTAL.search(dump.read_text(encoding="utf-8"))
    if found is None:
        raise AssertionError(f"callgrind's {dump.name} has no totals")
    return int(found[1])


KINDS: Sequence[Kind] = (
    Kind("opcodes", "Python opcodes", python, lambda: replayed("opcodes")),
    Kind("bytes", "bytes held at most", python, lambda: replayed("bytes")),
    Kind("instructions", "instructions", build, instructions),
    Kind("syscalls", "system calls", platform.system, system_calls),
)
