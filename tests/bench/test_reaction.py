"""Benchmark ``reaction``: every responder answers, and the tables of made-up samples."""

import shutil
from pathlib import Path

import pytest

from bench.reaction import loop
from bench.reaction.board import BREAK, CLEAR, HIT, STANDS, STOP, compiled
from bench.reaction.measure import block
from bench.reaction.page import latency_table, targets
from bench.reaction.responders import (
    DDS,
    DDS_FIFO,
    JUDGED,
    LOADS,
    LOOP,
    ORDINARY,
    POOLED,
    REFLEX,
    RESPONDERS,
    Responder,
)
from bench.series import Series

# One of each kind; the others differ in an argument.
TRIED = [each for each in RESPONDERS if each.name in (LOOP, REFLEX, ORDINARY, DDS_FIFO, POOLED)]


def test_the_one_process_has_the_frames_of_the_bridge() -> None:
    assert (loop.command(loop.BREAK).hex(), loop.command(loop.STOP).hex()) == (BREAK, STOP)
    received = [bytes.fromhex(each) for each in (HIT, CLEAR, STANDS, HIT[:-2] + "00", HIT[:6])]
    assert [loop.is_hit(each) for each in received] == [True, False, False, False, False]


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
@pytest.mark.campaign
@pytest.mark.parametrize("responder", TRIED, ids=lambda each: each.name)
def test_each_answers_every_hit(responder: Responder, tmp_path: Path) -> None:
    if responder.lacks:
        pytest.skip(f"{responder.lacks} is not installed; `make bench` wants it")
    times_ns = block(compiled(tmp_path), responder, 3)
    assert len(times_ns) == 3
    assert all(0 < ns < 1e9 for ns in times_ns)


def made_up(name: str, load: str, *times_us: int) -> Series:
    return Series(name=(name, load), samples_ns=[1000 * us for us in times_us])


def test_the_table_names_the_worst_miss() -> None:
    series = [
        made_up(LOOP, "quiet", *[10] * 99, 20),
        made_up(LOOP, "busy", *[10] * 100),
        made_up(REFLEX, "quiet", *[12] * 100),
        made_up(REFLEX, "busy", *[12] * 90, *[99] * 10),
    ]
    reached = targets(series)
    assert [target.is_reached for target in reached] == [True, True, True, False]
    assert latency_table({each.name: each for each in series}, reached).splitlines()[3] == (
        f"| {REFLEX} | 12 | 12 | 12 | × 1.2 | 12 | 99 | 99 | × 1.2 "
        "| 3 of 4 reached, worst × 9.90 of × 1.5 |"
    )


def test_ordinary_rows_are_compared_on_a_quiet_host_only() -> None:
    rows = [made_up(name, load, 10) for name in (LOOP, JUDGED, DDS_FIFO) for load in LOADS]
    rows += [made_up(name, "quiet", 10) for name in (ORDINARY, DDS)]
    reached = targets(rows)
    assert [target.row for target in reached] == [JUDGED] * 4 + [ORDINARY] * 2
    last = latency_table({each.name: each for each in rows}, reached).splitlines()[-1]
    assert last == f"| {DDS} | 10 | 10 | 10 | × 1.0 |  |  |  |  |  |"
