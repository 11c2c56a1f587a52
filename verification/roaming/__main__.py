"""``python -m verification.roaming``: drive over a bad link, and lose it, as a document."""

import argparse
import os
import platform
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from services.safety.config import SafetyConfig
from verification.faults.__main__ import today
from verification.faults.catalogue import NOTICE_S
from verification.faults.namespaces import Requirement, enter, missing
from verification.faults.stack_fixture import SPEED_MPS
from verification.harness.host import StallRecorder
from verification.roaming import page
from verification.roaming.conditions import OUTAGES, STEADY, Outage, Steady
from verification.roaming.hosts import Site, site
from verification.roaming.page import Backs, Wents
from verification.roaming.trial import Back, Went, outage, steady

SECONDS = 5.0
PAGE = Path(__file__).with_name("page.md")
CANNOT = 3  # exit code where two hosts cannot be made here
# What a source's request holds, as shipped, and what it takes to notice.
SHIPPED = SafetyConfig().safety
BUDGET_S = SHIPPED.sources["teleop"].lease + NOTICE_S
NEEDS: tuple[Requirement, ...] = ("remote driver", "separate clocks")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the campaign."""
    options = _arguments().parse_args(argv)
    lacking = missing(enter())
    for need in NEEDS:
        if need in lacking:
            print(f"two hosts cannot be made here: {lacking[need]}", file=sys.stderr)
            return CANNOT
    weathers = [one for one in STEADY if _wanted(one.name, options.only)]
    losses = [
        replace(one, times=min(one.times, options.times))
        for one in OUTAGES
        if _wanted(one.name, options.only)
    ]
    began_s = time.monotonic()
    with StallRecorder() as holdups, tempfile.TemporaryDirectory() as folder:
        wents, backs = campaign(Path(folder), weathers, losses, holdups, options.seconds)
    text = report(wents, backs, time.monotonic() - began_s)
    print(text)
    if options.out:
        options.out.write_text(text, encoding="utf-8")
    return int(bool(wrong(backs)))


def wrong(backs: Backs) -> list[str]:
    """Return what is not as it should be, by the shipped limits."""
    return page.wrong(backs, BUDGET_S, SHIPPED.bumper_age)


def _wanted(name: str, only: Sequence[str]) -> bool:
    return not only or any(text in name for text in only)


def campaign(
    folder: Path,
    weathers: Sequence[Steady],
    losses: Sequence[Outage],
    holdups: StallRecorder,
    seconds: float,
) -> tuple[Wents, Backs]:
    """Try all; the robot's router is another one where nothing is thinned."""
    wents: dict[str, tuple[Steady, Went, float]] = {}
    backs: list[tuple[Outage, Sequence[Back], float]] = []
    for thinned, dashboard in ((True, True), (True, False), (False, True), (False, False)):
        mine = [w for w in weathers if (w.thinned, w.dashboard) == (thinned, dashboard)]
        lost = losses if thinned and dashboard else ()
        if not (mine or lost):
            continue
        room = folder / f"{thinned}-{dashboard}"
        with site(room, thinned=thinned, dashboard=dashboard) as it:
            for weather in mine:
                went = steady(it, weather, seconds)
                wents[weather.name] = weather, went, _held(holdups, went)
                print(
                    page.driving([wents[weather.name]], SPEED_MPS).splitlines()[-1], file=sys.stderr
                )
            for what in lost:
                some = _lost(it, what)
                backs.append((what, some, max(_held(holdups, back) for back in some)))
                print(page.returning(backs[-1:]).splitlines()[-1], file=sys.stderr)
    return [wents[weather.name] for weather in weathers], backs


def _lost(it: Site, what: Outage) -> list[Back]:
    return [outage(it, what, 3 + n % 2) for n in range(what.times)]


def _held(holdups: StallRecorder, what: Went | Back) -> float:
    return holdups.worst_s(what.since_ns, (what.until_ns - what.since_ns) / 1e9)


def report(wents: Wents, backs: Backs, took_s: float) -> str:
    """Return the campaign as a document."""
    parts = {
        "date": today(),
        "machine": f"{platform.machine()}, {os.cpu_count()} cores, Linux {platform.release()}",
        "python": platform.python_version(),
        "minutes": f"{took_s / 60:.0f}",
        "driving": page.driving(wents, SPEED_MPS),
        "seen": page.seen(wents),
        "returning": page.returning(backs),
        "own": page.own(wents, backs),
        "verdict": page.verdict(wrong(backs)),
    }
    return PAGE.read_text(encoding="utf-8").format(**parts)


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="roaming", description=__doc__)
    parser.add_argument("--seconds", type=float, default=SECONDS, help="in each weather")
    parser.add_argument("--times", type=int, default=99, help="at most, for each loss")
    parser.add_argument(
        "--only", action="append", default=[], metavar="TEXT", help="what is named so; repeatable"
    )
    parser.add_argument("--out", type=Path, metavar="FILE", help="where the document goes")
    return parser


if __name__ == "__main__":
    sys.exit(main())
