"""Run the gateway against independent ROS 2 peers, and print a table."""

import argparse
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from verification.harness.results import table
from verification.ros2 import build, dead, held_back, hostile, independent, older
from verification.ros2.fixture import Robot, robot_with_gateway

HEAD = "group", "check", "observation", ""

Check = tuple[str, str, Callable[[Robot], str]]  # group, name, check
Row = tuple[str, str, str, str]


def main(argv: Sequence[str] | None = None) -> int:
    """Return 1 when a check fails, and 0 when cargo is missing."""
    options = _parser().parse_args(argv)
    if not build.has_cargo():
        print("skipped: cargo is not installed; install Rust from https://rustup.rs")
        return 0
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # ends the processes of the check
    print("building the peer; the first time takes several minutes", flush=True)
    try:
        peer = build.crate()
    except build.BuildError as error:
        print(f"the crate of verification/ros2/peer cannot be built: {error}", file=sys.stderr)
        return 1
    with tempfile.TemporaryDirectory() as folder:
        rows = run(Path(folder), peer, chosen(options.only))
    print(f"\n{table(HEAD, rows)}")
    failed = sum(row[-1] != "ok" for row in rows)
    print(f"\n{len(rows)} checks, {failed} failed")
    return 1 if failed else 0


def chosen(only: str | None) -> list[Check]:
    """Return the checks with this text in their group or name, in their order."""
    found: list[Check] = [("hiroz", check.__name__, check) for check in independent.CHECKS]
    found += [
        ("zenoh", version, partial(older.version, zenoh=version)) for version in older.VERSIONS
    ]
    for module in (dead, hostile, held_back):
        group = module.__name__.rsplit(".", 1)[1]
        found += [(group, check.__name__, check) for check in module.CHECKS]
    return [each for each in found if not only or only in f"{each[0]} {each[1]}"]


def run(folder: Path, peer: Path, checks: Sequence[Check]) -> list[Row]:
    """Run each check on a stack of its own: a failed one must not disturb the next."""
    rows = []
    for number, (group, name, check) in enumerate(checks):
        own = folder / str(number)
        own.mkdir()
        rows.append(_row(own, peer, group, name, check))
        print(" ".join(rows[-1]), flush=True)
    return rows


def _row(folder: Path, peer: Path, group: str, name: str, check: Callable[[Robot], str]) -> Row:
    began_s = time.monotonic()
    try:
        with robot_with_gateway(folder, peer, independent.SETTINGS.get(name, ())) as robot:
            observed = check(robot)
    except Exception as error:
        traceback.print_exc()
        return group, name, f"{type(error).__name__}: {error}"[:300], "FAILED"
    return group, name, f"{observed} ({time.monotonic() - began_s:.0f} s)", "ok"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m verification.ros2", description=__doc__)
    parser.add_argument("--only", metavar="TEXT", help="checks with this text in group or name")
    return parser


if __name__ == "__main__":
    sys.exit(main())
