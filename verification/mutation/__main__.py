"""Run the gate: ``python -m verification.mutation [FILE]...``, all of its files by default.

``--changed`` takes those that differ from where the branch left main. Exit code 1 when a mutant
lives that is not in ``allowed.toml``, or one in there does not.
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
    """Return the files of the gate with their tests; exit when one is gone."""
    settings = tomllib.loads(Path("pyproject.toml").read_text("utf-8"))
    files: dict[str, list[str]] = settings["tool"]["mutants"]
    for path in (*files, *(test for tests in files.values() for test in tests)):
        if not Path(path).exists():
            sys.exit(f"pyproject.toml: tool.mutants: there is no {path}.")
    return files


def git(*words: str) -> str | None:
    """Return what git says, None when it fails or is not there."""
    try:
        done = subprocess.run(["git", *words], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()


def base() -> str | None:
    """Return the commit to compare with: where the branch left main; on main, the one before."""
    head, fork = git("rev-parse", "HEAD"), git("merge-base", "origin/main", "HEAD")
    return fork if fork and fork != head else git("rev-parse", "--verify", "HEAD~1")


def changed(files: dict[str, list[str]]) -> list[str]:
    """Return those of the files that differ from the base, committed or not; say so."""
    commit = base()
    diff = None if commit is None else git("diff", "--name-only", "--relative", commit)
    if commit is None or diff is None:
        print("mutants: skipped, no commit to compare with; `make mutants` tries all files")
        return []
    chosen = [file for file in files if file in diff.splitlines()]
    which = ", ".join(chosen) or "no file of the gate changed"
    print(f"mutants: since {commit[:7]}: {which}", flush=True)
    return chosen


def tried(file: str, tests: list[str]) -> tuple[int, list[Mutant]]:
    """Try one file and say what came of it; exit when nothing did."""
    began = time.monotonic()
    try:
        count, alive = run(file, tests, SCRATCH / file.removesuffix(".py").replace("/", "."))
    except (TrialError, subprocess.TimeoutExpired) as error:
        sys.exit(f"mutants: {file}: {error}")
    took_s = time.monotonic() - began
    print(f"{file}: {count} mutants, {len(alive)} not killed, {took_s:.0f} s", flush=True)
    return count, alive


def main(words: list[str]) -> None:
    """Choose, run, judge."""
    os.chdir(ROOT)
    files = gated()
    chosen = changed(files) if words == ["--changed"] else words or list(files)
    if strange := set(chosen) - set(files):
        sys.exit(f"mutants: not in the gate: {', '.join(sorted(strange))}")
    chosen = sorted(chosen, key=lambda file: -Path(file).stat().st_size)  # the long ones first
    with ProcessPoolExecutor(AT_ONCE) as pool:
        results = pool.map(tried, chosen, [files[file] for file in chosen])
        found = dict(zip(chosen, results, strict=True))
    counts = {file: count for file, (count, _) in found.items()}
    living = [mutant for _, alive in found.values() for mutant in alive]
    wrong = complaints(counts, living, entries(ALLOWED))
    for complaint in wrong:
        print(f"\n{complaint}")
    if wrong:
        sys.exit(
            f"mutants: {len(wrong)} complaints; write a test, or see docs/adr/0009-mutation.md"
        )


if __name__ == "__main__":
    main(sys.argv[1:])
