"""``python -m verification.mutation [FILE]...``: mutation testing of the gated files.

The default is all gated files; ``--changed`` selects those that differ from the fork point of the
branch. Exit code 1 when a surviving mutant is not in ``allowed.toml``, or a listed one was killed.
"""

import os
import subprocess
import sys
import time
import tomllib
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from verification.mutation.trial import TrialError, run
from verification.mutation.verdict import Mutant, complaints, entries

ROOT = Path(__file__).parents[2]
ALLOWED = Path(__file__).with_name("allowed.toml")
SCRATCH = Path("mutants")
AT_ONCE = os.cpu_count() or 1


def gated() -> dict[str, list[str]]:
    """Return the gated files with their tests; exit when one does not exist."""
    settings = tomllib.loads(Path("pyproject.toml").read_text("utf-8"))
    files: dict[str, list[str]] = settings["tool"]["mutants"]
    for path in (*files, *(test for tests in files.values() for test in tests)):
        if not Path(path).exists():
            sys.exit(f"pyproject.toml: tool.mutants: {path} does not exist.")
    return files


def git(*words: str) -> str | None:
    """Return the output of git; None when it fails or is missing."""
    try:
        done = subprocess.run(["git", *words], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()


def base() -> str | None:
    """Return the commit to compare with: the fork point; on main, the previous commit."""
    head, fork = git("rev-parse", "HEAD"), git("merge-base", "origin/main", "HEAD")
    return fork if fork and fork != head else git("rev-parse", "--verify", "HEAD~1")


def changed(files: dict[str, list[str]]) -> list[str]:
    """Return and print the files that differ from the base, committed or not."""
    commit = base()
    diff = None if commit is None else git("diff", "--name-only", "--relative", commit)
    if commit is None or diff is None:
        print("mutants: skipped, no commit to compare with; `make mutants` tests all files")
        return []
    chosen = [file for file in files if file in diff.splitlines()]
    which = ", ".join(chosen) or "no gated file changed"
    print(f"mutants: since {commit[:7]}: {which}", flush=True)
    return chosen


def run_file(file: str, tests: list[str]) -> tuple[int, list[Mutant]]:
    """Test one file and print the result; exit when the run fails."""
    began = time.monotonic()
    try:
        count, surviving = run(file, tests, SCRATCH / file.removesuffix(".py").replace("/", "."))
    except (TrialError, subprocess.TimeoutExpired) as error:
        sys.exit(f"mutants: {file}: {error}")
    took_s = time.monotonic() - began
    print(f"{file}: {count} mutants, {len(surviving)} not killed, {took_s:.0f} s", flush=True)
    return count, surviving


def main(words: list[str]) -> None:
    """Choose files, test them, compare with the list."""
    os.chdir(ROOT)
    files = gated()
    chosen = changed(files) if words == ["--changed"] else words or list(files)
    if unknown := set(chosen) - set(files):
        sys.exit(f"mutants: not gated: {', '.join(sorted(unknown))}")
    chosen = sorted(chosen, key=lambda file: -Path(file).stat().st_size)  # largest first
    with ProcessPoolExecutor(AT_ONCE) as pool:
        results = pool.map(run_file, chosen, [files[file] for file in chosen])
        found = dict(zip(chosen, results, strict=True))
    counts = {file: count for file, (count, _) in found.items()}
    survivors = [mutant for _, surviving in found.values() for mutant in surviving]
    wrong = complaints(counts, survivors, entries(ALLOWED))
    for complaint in wrong:
        print(f"\n{complaint}")
    if wrong:
        sys.exit(
            f"mutants: {len(wrong)} differences; write a test, or see docs/adr/0009-mutation.md"
        )


if __name__ == "__main__":
    main(sys.argv[1:])
