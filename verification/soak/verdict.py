"""Verdict of a soak: growth of resources, stuck laps, crashes, and motion while it must stand.

A process is judged by its longest run: shorter runs end with a kill, and sessions come and go in
them. The first minute is warm-up. Afterwards the median of the first fifth is compared with the
median of the last fifth. Every process must have one run that is long enough.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import median

from cli.demo.score import Result
from common.freshness import NS_PER_S
from sim import trace as t
from verification.harness.trace import moves
from verification.soak.record import Life, Record, Sample, Window

GROWTH_MAX = 2 * 2**20  # bytes of memory
LOG_MAX = 2000.0  # bytes/s on average, all services together, faults included
LOG_PEAK_MAX = 10_000.0  # bytes/s in the worst ten seconds
PEAK_S = 10
SILENCE_MAX_S = 20.0  # of health: a killed service is restarted after some seconds
SAMPLES_MIN = 10  # of a run that is judged; a fifth of it is 2


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of a soak, by its duration and by the host."""

    warm_up_s: float
    lap_s: float  # in each such period one lap must be finished
    stuck_s: float  # without a step done


def results(record: Record, limits: Limits) -> list[Result]:
    """Return the results; a soak is good when none is False."""
    return [
        *_processes(record.lives, limits.warm_up_s),
        _log(record.log),
        ("tracebacks in the log", str(record.tracebacks), record.tracebacks == 0),
        ("crashes", ", ".join(record.crashes) or "none", not record.crashes),
        *_health(record.health, record.seconds),
        ("faults", str(len(record.faults)), len(record.faults) > 0),
        *_laps(record, limits),
        _moved(record),
        ("lateness of the soak's loop", f"{record.late_s:.2f} s at most", None),
    ]


def good(rows: Sequence[Result]) -> bool:
    """Return whether all results are good."""
    return all(fine is not False for _, _, fine in rows)


def growth(samples: Sequence[Sample], warm_up_s: float) -> tuple[Sample, Sample] | None:
    """Return the medians of the first and the last fifth after warm-up; None if too short."""
    warm = [sample for sample in samples if sample.at_s - samples[0].at_s >= warm_up_s]
    if len(warm) < SAMPLES_MIN:
        return None
    fifth = len(warm) // 5
    return _median(warm[:fifth]), _median(warm[-fifth:])


def too_late(runs: Iterable[t.Command], window: Window) -> list[tuple[str, float]]:
    """Return moving commands within a window: the fault, and the time in seconds."""
    return [
        (window.name, (run.mono_ns - window.from_ns) / NS_PER_S)
        for run in runs
        if moves(run) and window.from_ns <= run.mono_ns < window.to_ns
    ]


def _median(samples: Sequence[Sample]) -> Sample:
    return Sample(
        median(sample.at_s for sample in samples),
        round(median(sample.rss for sample in samples)),
        round(median(sample.threads for sample in samples)),
        round(median(sample.descriptors for sample in samples)),
    )


def _processes(lives: Mapping[Life, Sequence[Sample]], warm_up_s: float) -> list[Result]:
    rows: list[Result] = []
    for name in dict.fromkeys(run.name for run in lives):
        longest = max((lives[run] for run in lives if run.name == name), key=len)
        span = growth(longest, warm_up_s)
        if span is None:
            rows.append((f"{name}: memory", "no run was long enough", False))
            continue
        first, last = span
        grown = last.rss - first.rss
        amount = (
            f"{last.rss / 2**20:.1f} MB, {grown / 2**20:+.2f} in {last.at_s - first.at_s:.0f} s"
        )
        rows.append((f"{name}: memory", amount, grown < GROWTH_MAX))
        threads = last.threads - first.threads
        descriptors = last.descriptors - first.descriptors
        held = f"{last.threads} {threads:+d}, {last.descriptors} {descriptors:+d}"
        rows.append((f"{name}: threads, descriptors", held, threads <= 0 and descriptors <= 0))
    return rows


def _log(log: Sequence[tuple[float, int]]) -> Result:
    total = log[-1][1] if log else 0
    rate = total / max(1.0, log[-1][0]) if log else 0.0
    later = log[PEAK_S:]
    peak = max(((b[1] - a[1]) / PEAK_S for a, b in zip(log, later, strict=False)), default=rate)
    amount = f"{total / 1000:.0f} kB, {rate:.0f} bytes/s, {peak:.0f} in the worst {PEAK_S} s"
    return "log", amount, total > 0 and rate <= LOG_MAX and peak <= LOG_PEAK_MAX


def _health(health: Mapping[str, Sequence[float]], end_s: float) -> list[Result]:
    rows: list[Result] = []
    for service, times in sorted(health.items()):
        beats = [*times, end_s]
        silence = max(b - a for a, b in pairwise(beats))
        amount = f"{len(times)} messages, silent for {silence:.1f} s at most"
        rows.append((f"{service}: health", amount, silence <= SILENCE_MAX_S))
    return rows or [("health", "no health message", False)]


def _laps(record: Record, limits: Limits) -> list[Result]:
    events = [progress.what for progress in record.progress]
    finished, wanted = events.count("lap finished"), int(record.seconds // limits.lap_s)
    steps = [progress.at_s for progress in record.progress if progress.what == "step"]
    stuck_s = max(b - a for a, b in pairwise([0.0, *steps, record.seconds]))
    moving = bool(steps) and stuck_s <= limits.stuck_s
    return [
        ("laps finished", f"{finished}, at least {wanted} wanted", finished >= wanted),
        ("laps restarted", str(events.count("begun anew")), None),
        ("longest time without a step done", f"{stuck_s:.0f} s", moving),
    ]


def _moved(record: Record) -> Result:
    what = "RUN while it must stand"
    if not record.moved:
        return what, f"none in {len(record.windows)} faults", True
    name, late_s = max(record.moved, key=lambda one: one[1])
    return what, f"{len(record.moved)}, {late_s:.2f} s too late after {name}", False
