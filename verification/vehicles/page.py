"""The page of the campaign. Pure, but for the date and the name of the machine."""

import platform
from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from statistics import mean, median

from verification.harness.host import description
from verification.harness.results import percentile, table
from verification.vehicles.draw import ranges
from verification.vehicles.judge import CHI2_95
from verification.vehicles.run import Result

TEMPLATE = Path(__file__).with_name("page.md")
WORST = 10

_FAULTS = [one for one in ranges() if one.fault]


def page(results: Sequence[Result]) -> str:
    """Return the page of these results."""
    sound = [result for result in results if not result.faulty]
    return TEMPLATE.read_text(encoding="utf-8").format(
        date=datetime.now(UTC).date().isoformat(),
        runs=f"{len(results):,}",
        hours=f"{sum(result.seconds for result in results) / 3600:.1f}",
        machine=description(),
        python=platform.python_version(),
        cpu=f"{median(result.cpu_s / result.seconds for result in results):.2f}",
        results=summary(results),
        stops=stops(sound),
        worst=worst(results),
        faults=by_fault(results),
        odometry=odometry(sound),
        ranges=drawn(),
    )


def summary(results: Sequence[Result]) -> str:
    """Return the table of both kinds of runs."""
    head = (
        "", "runs", "driven", "contacts", "broke an invariant", "completed",
        "hours between needless stops",
    )  # fmt: skip
    rows = []
    for name, chosen in (
        ("no fault", [result for result in results if not result.faulty]),
        ("with faults", [result for result in results if result.faulty]),
    ):
        if chosen:
            rows.append((name, *_summary(chosen)))
    return table(head, rows)


def _summary(results: Sequence[Result]) -> Sequence[str]:
    broken = sum(bool(result.violations) for result in results)
    hours = sum(result.seconds for result in results) / 3600
    needless = sum(len(result.stops) for result in results)
    finished = mean(result.completed for result in results)
    between = f"{hours / needless:.2g}" if needless else f"none in {hours:.1f}"
    return (
        f"{len(results):,}",
        f"{sum(result.metres for result in results) / 1000:.2f} km",
        f"{sum(result.contacts for result in results)}",
        f"{broken}",
        f"{finished:.2%}",
        "" if results[0].faulty else between,
    )


def stops(sound: Sequence[Result]) -> str:
    """Return the table of the causes of needless stops."""
    counts = Counter(stop.cause for result in sound for stop in result.stops)
    seeds = {
        cause: [r.seed for r in sound if any(stop.cause == cause for stop in r.stops)]
        for cause in counts
    }
    rows = [
        (
            f"`{cause}`",
            str(count),
            str(len(seeds[cause])),
            ", ".join(map(str, seeds[cause][:WORST])),
        )
        for cause, count in counts.most_common()
    ]
    if not rows:
        return "None."
    return table(("cause", "stops", "runs", "the first seeds"), rows)


def worst(results: Sequence[Result]) -> str:
    """Return the table of the worst runs: violations first, then unfinished scripts."""
    rows = [
        (str(result.seed), _faults(result), _why(result))
        for result in sorted(results, key=_badness, reverse=True)[:WORST]
        if _badness(result) > (0, 0, 0)
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
    """Return the faults that were drawn."""
    drawn = [(one.name, result.values[one.name]) for one in _FAULTS if one.name in result.values]
    return ", ".join(f"`{name}` {value}" for name, value in drawn) or "none"


def by_fault(results: Sequence[Result]) -> str:
    """Return the table of runs by the fault that they have, alone or beside others."""
    rows = []
    for one in _FAULTS:
        with_it = [result for result in results if one.name in result.values]
        if with_it:
            unfinished = [result.seed for result in with_it if not result.finished]
            seeds = ", ".join(map(str, unfinished[:5]))
            rows.append((f"`{one.name}`", str(len(with_it)), str(len(unfinished)), seeds))
    return table(("fault", "runs", "not finished", "the first seeds"), rows)


def odometry(sound: Sequence[Result]) -> str:
    """Return the table of odometry's errors."""
    last = [(result.errors[-1], result.metres) for result in sound if result.errors]
    rows = []
    for name, values, unit in (
        ("position", [error.position for error, _ in last], "m"),
        ("heading", [error.heading for error, _ in last], "rad"),
        ("NEES", [error.nees for error, _ in last], ""),
    ):
        row = (percentile(values, share) for share in (0.5, 0.95, 1.0))
        rows.append((name, f"{mean(values):.3g} {unit}", *(f"{value:.3g} {unit}" for value in row)))
    inside = mean(error.nees <= CHI2_95 for error, _ in last)
    rows.append((f"share with NEES at most {CHI2_95:g}", f"{inside:.1%}", "", "", ""))
    return table(("error", "mean", "p50", "p95", "worst"), rows)


def drawn() -> str:
    """Return the table of ranges."""
    rows = [
        (f"`{one.name}`", one.text, f"{one.chance:.0%}", "yes" if one.fault else "", one.why)
        for one in ranges()
    ]
    return table(("parameter", "values", "chance", "fault", "why"), rows)
