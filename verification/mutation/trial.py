"""Run mutmut on one file in a copy of the source, and judge the mutants that no test killed.

A mutant counts as killed only when a test fails. Every other outcome, such as an endless loop, is a
survivor. A survivor is allowed when it is equivalent to the original: then a row of
``equivalent.toml`` gives its line, the number of such mutants, and the reason.
"""

import contextlib
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from mutmut.mutation.data import SourceFileMutationData
from mutmut.mutation.diff_apply import get_diff_for_mutant
from mutmut.utils.format_utils import orig_function_and_class_names_from_key

from verification.mutation.equivalent import Row

KILLED = 1  # pytest: a test failed
OUTCOMES = {None: "not run", 0: "survived", 33: "untested", 36: "endless", -24: "endless"}
# The client library lies beside the other packages, as where it is installed.
SDK = "sdk/"
COPIED = "sdk/t2", "cli", "common", "config", "services", "sim", "tests", "verification"
LONGEST_S = 2 * 3600  # timeout of one file, also on a slow host
SETTINGS = """\
[mutmut]
source_paths =
    t2
    common
    services
    sim
    cli
only_mutate = {file}
also_copy =
    config
    verification
# Without conftest the tests do not load zenoh; this profile makes hypothesis deterministic. The
# plugin of the client library would import the one that is installed, without mutants.
pytest_add_cli_args =
    --noconftest
    -p
    no:t2
    --hypothesis-profile=ci
    -m
    not campaign
pytest_add_cli_args_test_selection =
    {tests}
# At least 30 s, and three times the normal duration: only an endless loop takes longer.
timeout_constant = 10.0
timeout_multiplier = 3.0
track_dependencies = false
use_git_change_detection = false
"""


class TrialError(Exception):
    """mutmut failed."""


class Survivor(NamedTuple):
    """A change of the source that no test detected."""

    outcome: str
    function: str  # ``Class.method``
    diff: str

    @property
    def line(self) -> str:
        """The first changed line, without its indent."""
        body = self.diff.splitlines()[2:]
        return next(line[1:].strip() for line in body if line.startswith("-"))


def run(file: str, tests: Sequence[str], where: Path) -> tuple[int, list[Survivor]]:
    """Return the number of mutants of a file, and the survivors."""
    shutil.rmtree(where, ignore_errors=True)
    for part in COPIED:
        to = where / part.removeprefix(SDK)
        shutil.copytree(part, to, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy("pyproject.toml", where)
    file = file.removeprefix(SDK)
    settings = SETTINGS.format(file=file, tests="\n    ".join(tests))
    (where / "setup.cfg").write_text(settings, "utf-8")
    with contextlib.chdir(where):
        _mutmut()
        data = SourceFileMutationData(path=file)
        data.load()
        codes = data.exit_code_by_key
        return len(codes), [
            Survivor(
                OUTCOMES.get(code, f"exit code {code}"),
                function_of(name),
                get_diff_for_mutant(name, path=file),
            )
            for name, code in codes.items()
            if code != KILLED
        ]


def _mutmut() -> None:
    output = Path("output.txt")
    command = [str(Path(sys.executable).with_name("mutmut")), "run", "--max-children", "1"]
    with output.open("wb") as file:
        ended = subprocess.run(
            command, stdout=file, stderr=subprocess.STDOUT, timeout=LONGEST_S, check=False
        )
    if ended.returncode:
        log = output.read_text("utf-8", errors="replace")[-3000:]
        raise TrialError(f"{log}\nmutmut ended with exit code {ended.returncode}")


def function_of(mutant: str) -> str:
    """Return the function that mutmut changed in this mutant."""
    name, class_name = orig_function_and_class_names_from_key(mutant)
    return f"{class_name}.{name}" if class_name else name


def complaints(rows: Iterable[Row], survivors: Sequence[Survivor]) -> list[str]:
    """Return the lines whose survivors are not as many as their row gives, with the diffs."""
    allowed = Counter({(row.function, row.line): row.mutants for row in rows})
    found = Counter((survivor.function, survivor.line) for survivor in survivors)
    return [
        "\n".join([
            f"{found[key]} survivors, {allowed[key]} equivalent in the table: {key[0]}: {key[1]}",
            *(f"{one.outcome}\n{one.diff}" for one in survivors if (one.function, one.line) == key),
        ])
        for key in dict.fromkeys([*found, *allowed])
        if found[key] != allowed[key]
    ]  # fmt: skip
