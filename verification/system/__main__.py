"""``python -m verification.system``: test T2's installations on this host's Docker engine.

They need root and Debian's ``debootstrap``. ``SUITE`` names another Debian than bookworm.
"""

import argparse
import sys
import time
from types import ModuleType

from verification.system import containers, relay, systemd
from verification.system.frame import lacking

INSTALLATIONS = {"containers": containers, "systemd": systemd, "relay": relay}


def main() -> int:
    """Run the checks of one installation, or of all; a failed check ends the run."""
    parser = argparse.ArgumentParser(prog="python -m verification.system", description=__doc__)
    parser.add_argument("names", nargs="*", help=f"{', '.join(INSTALLATIONS)}; all by default")
    names = parser.parse_args().names
    if reason := lacking():
        print(f"system-test: NOT RUN: {reason}")
        return 0
    for name in names or INSTALLATIONS:
        run_checks(INSTALLATIONS[name])
    return 0


def run_checks(tested: ModuleType) -> None:
    """Start an installation, and print the result of each check."""
    with tested.started() as installation:
        for check in tested.CHECKS:
            began_s = time.monotonic()
            print(f"{check.__name__:24} ", end="", flush=True)
            print(f"{check(installation)} ({time.monotonic() - began_s:.0f} s)", flush=True)


if __name__ == "__main__":
    sys.exit(main())
