"""``python -m verification.systemd``: install T2 into a bare Debian, and see systemd keep it."""

import argparse
import subprocess
import sys
import time
from pathlib import Path

from verification.systemd.checks import CHECKS
from verification.systemd.machine import Machine, booted, lacking

ROOT = Path(__file__).parents[2]
PYTHONS = {"bookworm": "3.11", "trixie": "3.13"}  # what Debian has


def main() -> int:
    """Print a row for each check; return 1 when one has failed."""
    parser = argparse.ArgumentParser(prog="python -m verification.systemd")
    parser.add_argument("--suite", choices=PYTHONS, default="bookworm", help="which Debian")
    parser.add_argument("--stay", action="store_true", help="leave a failed machine for a look")
    options = parser.parse_args()
    if why := lacking():
        print(f"did not run: {why}")
        return 0
    subprocess.run(
        ["make", "--silent", "wheelhouse", f"WHEEL_PYTHON={PYTHONS[options.suite]}"],
        cwd=ROOT, check=True,
    )  # fmt: skip
    with booted(options.suite, ROOT / "build" / "wheelhouse") as machine:
        print(machine.said("systemctl", "--version").splitlines()[0], "on", options.suite)
        return checked(machine, options.stay)


def checked(machine: Machine, stay: bool) -> int:
    """Check until something fails."""
    for check in CHECKS:
        started_s = time.monotonic()
        try:
            seen, code = check(machine), 0
        except (AssertionError, subprocess.SubprocessError) as error:
            seen, code = f"FAILED: {error}", 1
        took_s = time.monotonic() - started_s
        print(f"{check.__name__:16} {took_s:6.1f} s  {seen}", flush=True)
        if code:
            print(machine.tried("journalctl", "-o", "cat", "-n", "60", "-u", "t2-*").stdout)
            if stay:
                input(f"docker exec -it {machine.name} bash; enter ends it ")
            return code
    return 0


if __name__ == "__main__":
    sys.exit(main())
