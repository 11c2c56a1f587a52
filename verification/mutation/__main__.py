"""``python -m verification.mutation [FILE]...``: mutation testing of the cores.

The default is all cores; ``--changed`` selects those that differ from the fork point of the branch,
and ``--tests`` prints the tests of all cores instead.
Exit code 1 when a mutant survives that ``equivalent.toml`` does not name, when one that it names
was killed, or when a row of it fits no line.
"""

import os
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from verification.mutation.equivalent import TableError, check, table
from verification.mutation.selection import changed, cores
from verification.mutation.trial import TrialError, complaints, run

ROOT = Path(__file__).parents[2]
SCRATCH = Path("mutants")


def main(words: list[str]) -> None:
    """Choose files, test them, compare with the table."""
    os.chdir(ROOT)
    found = cores()
    if words == ["--tests"]:
        print(*sorted({test for tests in found.values() for test in tests}))
        return
    if unknown := set(words) - {"--changed", *found}:
        sys.exit(f"mutants: no core: {', '.join(sorted(unknown))}")
    chosen = changed(found) if words == ["--changed"] else {f: found[f] for f in words or found}
    try:
        check(table(), ROOT)
    except TableError as error:
        sys.exit(f"mutants: {error}")
    files = sorted(chosen, key=lambda file: -Path(file).stat().st_size)  # largest first
    with ProcessPoolExecutor() as pool:
        wrong = list(pool.map(judge, files, [chosen[file] for file in files]))
    if count := sum(wrong):
        sys.exit(f"mutants: {count} lines; write a test, or see docs/decisions.md, Mutation gate")


def judge(file: str, tests: list[str]) -> int:
    """Test one file and print the result; return the number of lines that are wrong."""
    try:
        count, surviving = run(file, tests, SCRATCH / file.removesuffix(".py").replace("/", "."))
    except (TrialError, subprocess.TimeoutExpired) as error:
        sys.exit(f"mutants: {file}: {error}")
    wrong = complaints([row for row in table() if row.file == file], surviving)
    print(
        f"{file}: {count} mutants, {len(surviving)} not killed",
        *(f"\n{file}: {complaint}\n" for complaint in wrong), sep="\n" if wrong else "", flush=True,
    )  # fmt: skip
    return len(wrong)


if __name__ == "__main__":
    main(sys.argv[1:])
