"""The page of the campaign. Pure, but for the date and the name of the machine."""

import platform
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from statistics import mean, median

from verification.harness.host import description
from verification.harness.results import filled, percentile, table
from verification.search.draw import ranges
from verification.search.judge import CHI2_95
from verification.search.run import Result

PAGE = Path(__file__).parents[2] / "docs" / "vehicles.md"
WORST = 10
FAULTS = [one.name for one in ranges() if one.fault]


def page(results: Sequence[Result]) -> str:
    """Return the page with the blocks of these results."""
    sound = [result for result in results if not result.faulty]
    faulty = [result for result in results if result.faulty]
    blocks = {
        "made": made(results),
        "results": summary({"no fault": sound, "with faults": faulty}),
        "worst": worst(results),
        "odometry": odometry(sound),
    }
    return filled(PAGE.read_text(encoding="utf-8"), blocks)


def made(results: Sequence[Result]) -> str:
    """Return when, how and where the runs were made."""
    hours = sum(result.seconds for result in results) / 3600
    cpu = median(result.cpu_s / result.seconds for result in results)
    return (
        f"Made on {datetime.now(UTC).date().isoformat()} by {len(results):,} runs, "
        f"{hours:.1f} hours of simulated time: {description()}, "
        f"Python {platform.python_version()}. "
        f"A second of simulated time took {cpu:.2f} s of CPU at the median."
    )


def summary(kinds: dict[str, Sequence[Result]]) -> str:
    """Return the table of both kinds of runs."""
    rows = [
        (
            name,
            f"{len(results):,}",
            f"{sum(result.metres for result in results) / 1000:.2f} km",
            f"{sum(result.contacts for result in results)}",
            f"{sum(bool(result.violations) for result in results)}",
            f"{sum(len(result.stops) for result in results)}",
            f"{mean(result.completed for result in results):.2%}" if results else "",
        )
        for name, results in kinds.items()
    ]
    head = "", "runs", "driven", "contacts", "broke an invariant", "needless stops", "completed"
    return table(head, rows)


def worst(results: Sequence[Result]) -> str:
    """Return the table of the worst runs: violations first, then unfinished scripts."""
    rows = [
        (str(result.seed), _faults(result), _why(result))
        for result in sorted(results, key=_badness, reverse=True)[:WORST]
        if any(_badness(result))
    ]
    return table(("seed", "faults", "what happened"), rows) if rows else "None."


def _badness(result: Result) -> tuple[int, int, int]:
    return len(result.violations), int(not result.finished), len(result.stops)


def _why(result: Result) -> str:
    if result.violations:
        return result.violations[0]
    if result.stops:
        return "; ".join(f"{stop.at_s:.1f} s: {stop.text}" for stop in result.stops[:2])
    longest = [f"`{name}` for {seconds:.0f} s" for name, seconds in result.held.items()][:3]
    return ", ".join(["the script was not finished", *longest])


def _faults(result: Result) -> str:
    drawn = [f"`{name}` {result.values[name]}" for name in FAULTS if name in result.values]
    return ", ".join(drawn) or "none"


def odometry(sound: Sequence[Result]) -> str:
    """Return the table of odometry's errors at the end of the runs."""
    last = [result.error for result in sound if result.error]
    rows = []
    for name, unit in (("position", " m"), ("heading", " rad"), ("nees", "")):
        values = [float(getattr(error, name)) for error in last]
        shares = (percentile(values, share) for share in (0.5, 0.95, 1.0))
        rows.append((name, *(f"{value:.3g}{unit}" for value in (mean(values), *shares))))
    inside = mean(error.nees <= CHI2_95 for error in last)
    rows.append((f"share with nees at most {CHI2_95:g}", f"{inside:.1%}", "", "", ""))
    return table(("error", "mean", "p50", "p95", "worst"), rows)
