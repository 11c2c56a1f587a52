"""``python -m tools.run_tests ARGUMENTS``: pytest, with a second run of the tests that failed.

Most tests start real processes with real time limits, and several run at once. A host that stalls
processes fails a few of them. So the tests that failed run a second time, one by one, with the
machine to themselves. A test that fails again fails the run; the others are listed at the end and
in ``out/second-run.txt``, after those of earlier runs: ``make check`` prints that file last.

Many failures have another cause: with more than ``RETRIED_MAX`` there is no second run.
"""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

FAILED = 1  # pytest's exit code for failed tests, as opposed to usage errors and interrupts
RETRIED_MAX = 30
CACHE = Path(".pytest_cache/v/cache/lastfailed")
NAMES = Path("out/second-run.txt")


def main(arguments: Sequence[str]) -> int:
    """Run the tests; return pytest's exit code."""
    for one in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(one, signal.default_int_handler)  # as Ctrl-C
    CACHE.unlink(missing_ok=True)  # the failures of other runs
    code = pytest(arguments)
    if code != FAILED or not CACHE.exists():  # a test that hangs without xdist ends pytest at once
        return code
    failed = sorted(json.loads(CACHE.read_text("utf-8")))
    if not 0 < len(failed) <= RETRIED_MAX:
        return code
    print(f"\nrun_tests: {len(failed)} failed; they run once more, one by one", flush=True)
    again = ["--last-failed", "--last-failed-no-failures=none", "-n", "0"]
    code = pytest([*arguments, *again])
    if code == 0:
        NAMES.parent.mkdir(exist_ok=True)
        with NAMES.open("a", encoding="utf-8") as names:
            names.writelines(f"passed the second time only: {name}\n" for name in failed)
        print(NAMES.read_text(encoding="utf-8"), end="", flush=True)
    return code


def pytest(arguments: Sequence[str]) -> int:
    """Run pytest in its own process group; return its exit code."""
    with subprocess.Popen([sys.executable, "-m", "pytest", *arguments], process_group=0) as process:
        try:
            return process.wait()
        except KeyboardInterrupt:  # the terminal's Ctrl-C reaches this process's group only
            os.killpg(process.pid, signal.SIGINT)
            return process.wait()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
