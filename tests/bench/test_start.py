"""Benchmark ``start``: real starts, and the tables of made-up samples."""

import sys
from pathlib import Path

import pytest

from bench.reaction.board import STOP
from bench.start.page import ENOUGH, blocks, targets
from bench.start.rows import (
    BARE,
    BRIDGE,
    COMMANDS,
    FIRST_BREAK,
    FIRST_STOP,
    NOTHING,
    ODOM,
    ON_BUS,
    ROUTER,
    ROWS,
    SAFETY,
    site,
    started,
)  # fmt: skip
from tests.bench.start_series import made_up
from verification.harness.process_stats import children
from verification.harness.waiting import wait_until

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")


@LINUX
@pytest.mark.campaign
def test_each_row_is_timed() -> None:
    with site() as here:
        times = {name: ns for row in ROWS for name, ns in row(here).items()}
    whats = {(BRIDGE, what) for what in (FIRST_BREAK, FIRST_STOP, ON_BUS)}
    assert set(times) == {NOTHING, BARE, ROUTER, SAFETY, ODOM} | whats
    assert all(0 < ns < 20e9 for ns in times.values())
    assert times[BRIDGE, FIRST_BREAK] < times[BRIDGE, FIRST_STOP]


def test_the_script_sends_the_frame_of_the_bridge() -> None:
    assert COMMANDS[bytes.fromhex(STOP)] == FIRST_STOP


@LINUX
def test_children_are_killed_too() -> None:
    sleep = "import time; time.sleep(1000)"
    code = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {sleep!r}])"
    with started("-c", code) as (process, _):
        (child,) = wait_until(lambda: children(process.pid), "the child")
    assert process.returncode is not None
    wait_until(lambda: not lives(child), "the end of the child")


def lives(pid: int) -> bool:
    """Return whether a process runs and is not a zombie."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="ascii")
    except FileNotFoundError:
        return False
    return stat.rpartition(")")[2].split()[0] != "Z"


def test_the_table_is_in_the_order_of_the_starts() -> None:
    found = blocks(list(reversed(made_up(200))))
    assert found["samples"] == "10"
    assert found["table"].splitlines()[2:] == [
        "| `python -c pass` | its end | 10 | 10 |  | × 0.2 |  |",
        "| Python, a script | first STOP | 40 | 40 |  | × 1.0 |  |",
        "| T2, guard and bridge | first BRAKE | 100 | 100 |  | × 2.5 |  |",
        "| T2, guard and bridge | first STOP | 200 | 200 |  | × 5.0 | 1 of 1 reached |",
    ]
    assert "| 200 | 200 | 200 | × 5.0 | 1 of 1 reached |" in blocks(made_up(200, ENOUGH))["table"]


@pytest.mark.parametrize(("stop_ms", "word"), [(250, "reached"), (251, "not reached")])
def test_the_first_stop_has_a_target(stop_ms: int, word: str) -> None:
    (target,) = targets(made_up(stop_ms))
    assert target.cells[0] == f"{BRIDGE}, {FIRST_STOP}, p50: {stop_ms} ms"
    assert target.verdict == word
