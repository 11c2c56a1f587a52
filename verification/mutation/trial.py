"""One file at a time in a copy of the source: mutmut makes its mutants and lets its tests run."""

import contextlib
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from mutmut.mutation.data import SourceFileMutationData
from mutmut.mutation.diff_apply import get_diff_for_mutant

from verification.mutation.verdict import Mutant, changed_lines, outcome

LONGEST_S = 2 * 3600  # nothing waits for ever, not even on a slow machine
SETTINGS = """\
[mutmut]
source_paths =
    common
    services
only_mutate = {file}
# Without conftest there is no zenoh; by this profile hypothesis draws the same examples each time.
pytest_add_cli_args =
    --noconftest
    --hypothesis-profile=ci
pytest_add_cli_args_test_selection =
    {tests}
# At least 30 s, and three times what the tests take: only an endless loop gets there.
timeout_constant = 10.0
timeout_multiplier = 3.0
track_dependencies = false
use_git_change_detection = false
"""


class TrialError(Exception):
    """mutmut came to no result."""


def run(file: str, tests: Sequence[str], where: Path) -> tuple[int, list[Mutant]]:
    """Return how many mutants there are of a file, and those that no test killed."""
    shutil.rmtree(where, ignore_errors=True)
    for part in ("common", "services", "tests"):
        shutil.copytree(part, where / part, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy("pyproject.toml", where)
    settings = SETTINGS.format(file=file, tests="\n    ".join(tests))
    (where / "setup.cfg").write_text(settings, "utf-8")
    with contextlib.chdir(where):
        _mutmut()
        return _results(file)


def _mutmut() -> None:
    output = Path("output.txt")
    command = [str(Path(sys.executable).with_name("mutmut")), "run", "--max-children", "1"]
    with output.open("wb") as file:
        ended = subprocess.run(
            command, stdout=file, stderr=subprocess.STDOUT, timeout=LONGEST_S, check=False
        )
    if ended.returncode:
        said = output.read_text("utf-8", errors="replace")[-3000:]
        raise TrialError(f"{said}\nmutmut ended with exit code {ended.returncode}")


def _results(file: str) -> tuple[int, list[Mutant]]:
    data = SourceFileMutationData(path=file)
    data.load()
    alive = []
    for name, exit_code in data.exit_code_by_key.items():
        if became := outcome(exit_code):
            old, new = changed_lines(get_diff_for_mutant(name, path=file))
            alive.append(Mutant(file, _function(name), old, new, became))
    return len(data.exit_code_by_key), alive


def _function(mutant: str) -> str:
    """Return the function that mutmut's name of a mutant tells."""
    name = mutant.rpartition(".")[2].partition("__mutmut_")[0]
    return name.removeprefix("x_").removeprefix("xǁ").replace("ǁ", ".")
