"""The verdict of a soak, and a short real one."""

import subprocess
import sys
from pathlib import Path

import pytest

from verification.soak.verdict import GROWTH_MAX, Record, Sample, results

S = range(600)
SAFETY, RESTARTED = ("safety", 10), ("safety", 11)
PROCESSES = "router", "sim", "bridge", "bridge/1", "safety", "odom", "driver"


def samples(seconds: range = S, rss_per_s: float = 0.0, threads_from_s: int = 999) -> list[Sample]:
    return [Sample(s, 5e7 + rss_per_s * s, 10 + (s >= threads_from_s), 20) for s in seconds]


def wrong(record: Record) -> list[str]:
    return [what for what, _, fine in results(record) if not fine]


RESOURCES = "safety: threads, descriptors"


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({}, []),
        ({"lives": {SAFETY: samples(rss_per_s=0.9 * GROWTH_MAX / 432)}}, []),
        ({"lives": {SAFETY: samples(rss_per_s=1.1 * GROWTH_MAX / 432)}}, ["safety: memory"]),
        ({"lives": {SAFETY: samples(threads_from_s=30)}}, []),
        ({"lives": {SAFETY: samples(threads_from_s=150)}}, [RESOURCES]),
        ({"lives": {SAFETY: samples(range(69))}}, ["safety: memory"]),  # too short
        ({"lives": {SAFETY: samples(), RESTARTED: samples(range(99), 1e6)}}, []),
        ({"log_bytes": 2_010_000}, ["log"]),
        ({"violations": ["estop: never, 20.0 ms are allowed"]}, ["outside their limits"]),
        ({"crashes": ["odom"]}, ["crashes"]),
        ({"tracebacks": 1}, ["tracebacks in the log"]),
    ],
)
def test_each_limit(change: dict[str, object], expected: list[str]) -> None:
    record = Record(lives={SAFETY: samples()}, log_bytes=1_990_000, faults=200, seconds=600.0)
    for name, value in change.items():
        setattr(record, name, value)
    assert wrong(record) == expected


@pytest.mark.timed
@pytest.mark.campaign
@pytest.mark.timeout(200)
def test_a_short_soak(tmp_path: Path) -> None:
    """A minute is too short to measure growth: only that result may be wrong."""
    command = [sys.executable, "-m", "verification.soak", "--minutes", "0.8", "--seed", "22"]
    done = subprocess.run(
        [*command, "--out", str(tmp_path)], capture_output=True, text=True, timeout=180, check=False
    )
    rows = [line.split(" | ") for line in done.stdout.splitlines() if line.startswith("| ")]
    bad = [what for what, _, mark in rows if mark.startswith("WRONG")]
    assert all("memory" in what or "threads" in what for what in bad), done.stdout
    assert done.returncode == bool(bad), done.stderr
    assert {f"| {name}: memory" for name in PROCESSES} <= {what for what, *_ in rows}
