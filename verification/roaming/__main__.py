"""``python -m verification.roaming``: drive over a bad link, and lose it."""

import argparse
import platform
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from services.safety.config import SafetyConfig
from verification.faults.__main__ import today
from verification.faults.fault import NOTICE_S
from verification.faults.namespaces import Requirement, enter, missing
from verification.faults.stack_fixture import SPEED_MPS
from verification.harness.host import StallRecorder, short_description
from verification.roaming import page
from verification.roaming.conditions import CONDITIONS, OUTAGES, Condition, Outage
from verification.roaming.hosts import TwoHosts, two_hosts
from verification.roaming.page import DriveRows, OutageRows
from verification.roaming.trial import DriveResult, OutageResult, outage, steady

SECONDS = 5.0
PAGE = Path(__file__).with_name("page.md")
UNAVAILABLE = 3  # exit code when this machine cannot simulate two hosts
# The shipped lease of a request, and the time to detect its end.
SHIPPED = SafetyConfig().safety
BUDGET_S = SHIPPED.sources["teleop"].lease + NOTICE_S
NEEDS: tuple[Requirement, ...] = ("remote driver", "separate clocks")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the campaign."""
    options = _arguments().parse_args(argv)
    lacking = missing(enter())
    for need in NEEDS:
        if need in lacking:
            print(f"cannot simulate two hosts: {lacking[need]}", file=sys.stderr)
            return UNAVAILABLE
    conditions = [one for one in CONDITIONS if _wanted(one.name, options.only)]
    outage_list = [
        replace(one, times=min(one.times, options.times))
        for one in OUTAGES
        if _wanted(one.name, options.only)
    ]
    began_s = time.monotonic()
    with StallRecorder() as stalls, tempfile.TemporaryDirectory() as folder:
        drives, outages = campaign(Path(folder), conditions, outage_list, stalls, options.seconds)
    text = report(drives, outages, time.monotonic() - began_s)
    print(text)
    if options.out:
        options.out.write_text(text, encoding="utf-8")
    return int(bool(wrong(outages)))


def wrong(outages: OutageRows) -> list[str]:
    """Return the violations of the shipped limits."""
    return page.wrong(outages, BUDGET_S, SHIPPED.bumper_age)


def _wanted(name: str, only: Sequence[str]) -> bool:
    return not only or any(text in name for text in only)


def campaign(
    folder: Path,
    conditions: Sequence[Condition],
    outage_list: Sequence[Outage],
    stalls: StallRecorder,
    seconds: float,
) -> tuple[DriveRows, OutageRows]:
    """Run all; downsampling and dashboard need separate stacks."""
    drives: dict[str, tuple[Condition, DriveResult, float]] = {}
    outages: list[tuple[Outage, Sequence[OutageResult], float]] = []
    for downsampled, dashboard in ((True, True), (True, False), (False, True), (False, False)):
        mine = [w for w in conditions if (w.downsampled, w.dashboard) == (downsampled, dashboard)]
        lost = outage_list if downsampled and dashboard else ()
        if not (mine or lost):
            continue
        stack_folder = folder / f"{downsampled}-{dashboard}"
        with two_hosts(stack_folder, downsampled=downsampled, dashboard=dashboard) as it:
            for condition in mine:
                result = steady(it, condition, seconds)
                drives[condition.name] = condition, result, _held(stalls, result)
                print(
                    page.driving([drives[condition.name]], SPEED_MPS).splitlines()[-1],
                    file=sys.stderr,
                )
            for what in lost:
                some = _lost(it, what)
                outages.append((what, some, max(_held(stalls, back) for back in some)))
                print(page.returning(outages[-1:]).splitlines()[-1], file=sys.stderr)
    return [drives[condition.name] for condition in conditions], outages


def _lost(it: TwoHosts, what: Outage) -> list[OutageResult]:
    return [outage(it, what, 3 + n % 2) for n in range(what.times)]


def _held(stalls: StallRecorder, what: DriveResult | OutageResult) -> float:
    return stalls.worst_s(what.since_ns, (what.until_ns - what.since_ns) / 1e9)


def report(drives: DriveRows, outages: OutageRows, took_s: float) -> str:
    """Return the document of the campaign."""
    parts = {
        "date": today(),
        "machine": short_description(),
        "python": platform.python_version(),
        "minutes": f"{took_s / 60:.0f}",
        "driving": page.driving(drives, SPEED_MPS),
        "seen": page.seen(drives),
        "returning": page.returning(outages),
        "own": page.own(drives, outages),
        "verdict": page.verdict(wrong(outages)),
    }
    return PAGE.read_text(encoding="utf-8").format(**parts)


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="roaming", description=__doc__)
    parser.add_argument(
        "--seconds", type=float, default=SECONDS, help="duration of each condition, 5"
    )
    parser.add_argument("--times", type=int, default=99, help="trials of each outage, at most")
    parser.add_argument(
        "--only",
        action="append",
        default=[],
        metavar="TEXT",
        help="only conditions whose name contains TEXT; repeatable",
    )
    parser.add_argument("--out", type=Path, metavar="FILE", help="write the document here")
    return parser


if __name__ == "__main__":
    sys.exit(main())
