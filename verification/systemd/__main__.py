"""``python -m verification.systemd``: test T2's units in a Debian with systemd."""

import argparse
import subprocess
import sys
import time
from pathlib import Path

from verification.systemd.checks import CHECKS
from verification.systemd.machine import Machine, booted, image, lacking

ROOT = Path(__file__).parents[2]
PYTHONS = {"bookworm": "3.11", "trixie": "3.13"}  # what Debian has


def main() -> int:
    """Print a row for each check; return 1 when one fails."""
    parser = argparse.ArgumentParser(prog="python -m verification.systemd")
    parser.add_argument("--suite", choices=PYTHONS, default="bookworm", help="Debian release")
    parser.add_argument("--stay", action="store_true", help="keep a failed machine")
    options = parser.parse_args()
    if reason := lacking():
        print(f"did not run: {reason}")
        return 0
    subprocess.run(
        ["make", "--silent", "wheelhouse", f"WHEEL_PYTHON={PYTHONS[options.suite]}"],
        cwd=ROOT, check=True,
    )  # fmt: skip
    wheelhouse = f"{ROOT / 'build' / 'wheelhouse'}:/wheelhouse:ro"
    with booted(image(options.suite), "--volume", wheelhouse) as machine:
        print(machine.run("systemctl", "--version").splitlines()[0], "on", options.suite)
        return run_checks(machine, options.stay)


def run_checks(machine: Machine, stay: bool) -> int:
    """Run the checks until one fails."""
    for check in CHECKS:
        started_s = time.monotonic()
        try:
            seen, code = check(machine), 0
        except (AssertionError, subprocess.SubprocessError) as error:
            seen, code = f"FAILED: {error}", 1
        took_s = time.monotonic() - started_s
        print(f"{check.__name__:16} {took_s:6.1f} s  {seen}", flush=True)
        if code:
            print(machine.attempt("journalctl", "-o", "cat", "-n", "60", "-u", "t2-*").stdout)
            if stay:
                input(f"docker exec -it {machine.name} bash; press Enter to remove it ")
            return code
    return 0


if __name__ == "__main__":
    sys.exit(main())
