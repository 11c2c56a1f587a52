"""Run mutmut on one file in a copy of the source."""

import contextlib
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from mutmut.mutation.data import SourceFileMutationData
from mutmut.mutation.diff_apply import get_diff_for_mutant

from verification.mutation.verdict import Mutant, changed_lines, outcome

LONGEST_S = 2 * 3600  # timeout of one file, also on a slow host
SETTINGS = """\
[mutmut]
source_paths =
    common
    services
    sim
    cli
only_mutate = {file}
# Without conftest the tests do not load zenoh; this profile makes hypothesis deterministic.
pytest_add_cli_args =
    --noconftest
    --hypothesis-profile=ci
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


def run(file: str, tests: Sequence[str], where: Path) -> tuple[int, list[Mutant]]:
    """Return the number of mutants of a file, and the survivors."""
    shutil.rmtree(where, ignore_errors=True)
    for part in ("common", "services", "sim", "cli", "tests"):
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
        log = output.read_text("utf-8", errors="replace")[-3000:]
        raise TrialError(f"{log}\nmutmut ended with exit code {ended.returncode}")


def _results(file: str) -> tuple[int, list[Mutant]]:
    data = SourceFileMutationData(path=file)
    data.load()
    survivors = []
    for name, exit_code in data.exit_code_by_key.items():
        if result := outcome(exit_code):
            old, new = changed_lines(get_diff_for_mutant(name, path=file))
            survivors.append(Mutant(file, _function(name), old, new, result))
    return len(data.exit_code_by_key), survivors


def _function(mutant: str) -> str:
    """Return the function in mutmut's name of a mutant."""
    name = mutant.rpartition(".")[2].partition("__mutmut_")[0]
    return name.removeprefix("x_").removeprefix("xǁ").replace("ǁ", ".")
