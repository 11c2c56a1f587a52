"""Benchmark ``reaction``: every responder answers, and the tables of made-up samples."""

import shutil
from pathlib import Path

import pytest

from bench.reaction import loop
from bench.reaction.board import BREAK, CLEAR, HIT, STANDS, STOP, compiled
from bench.reaction.measure import block
from bench.reaction.page import latency_table, share, verdict
from bench.reaction.responders import (
    DDS,
    FIFO,
    JUDGED,
    LOOP,
    REFLEX,
    RESPONDERS,
    ZENOH,
    Responder,
)
from bench.series import Series


def test_the_one_process_has_the_frames_of_the_bridge() -> None:
    assert (loop.command(loop.BREAK).hex(), loop.command(loop.STOP).hex()) == (BREAK, STOP)
    received = [bytes.fromhex(each) for each in (HIT, CLEAR, STANDS, HIT[:-2] + "00", HIT[:6])]
    assert [loop.is_hit(each) for each in received] == [True, False, False, False, False]


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
@pytest.mark.campaign
@pytest.mark.parametrize("responder", RESPONDERS, ids=lambda each: each.name)
def test_each_answers_every_hit(responder: Responder, tmp_path: Path) -> None:
    if responder.lacks:
        pytest.skip(f"{responder.lacks} is not installed; `make bench` wants it")
    times_ns = block(compiled(tmp_path), responder, 3)
    assert len(times_ns) == 3
    assert all(0 < ns < 1e9 for ns in times_ns)


def made_up(name: str, load: str, *times_us: int) -> Series:
    return Series(name=(name, load), samples_ns=[1000 * us for us in times_us])


def test_the_verdict_names_each_figure() -> None:
    series = [
        made_up(LOOP, "quiet", *[10] * 99, 20),
        made_up(LOOP, "busy", *[10] * 100),
        made_up(REFLEX, "quiet", *[12] * 100),
        made_up(REFLEX, "busy", *[12] * 90, *[99] * 10),
    ]
    by_name = {each.name: each for each in series}
    assert latency_table(by_name).splitlines()[3] == (
        f"| {REFLEX} | 12 | 12 | 12 | × 1.2 | 12 | 99 | 99 | × 1.2 |"
    )
    found = verdict(by_name).splitlines()
    assert len(found) == 4  # no line without CycloneDDS
    assert found[1].endswith("quiet, p99: × 1.20 of × 1.5: reached")
    assert found[3].endswith("busy, p99: × 9.90 of × 1.5: not reached")
    both = [made_up(name, load, 10) for name in (JUDGED, DDS) for load in ("quiet", "busy")]
    assert len(verdict(by_name | {each.name: each for each in both}).splitlines()) == 8


def test_the_share_of_the_bus() -> None:
    rows = [(JUDGED, 20, 60), (ZENOH + FIFO, 10, 20), (DDS + FIFO, 5, 20)]
    series = [
        made_up(name, load, us)
        for name, *times_us in rows
        for load, us in zip(("quiet", "busy"), times_us, strict=True)
    ]
    by_name = {each.name: each for each in series}
    assert share(by_name) == (
        "Quiet: 10 us, × 2.0 of what CycloneDDS takes; T2 takes × 2.0 of that. "
        "Busy: 20 us, × 1.0 of what CycloneDDS takes; T2 takes × 3.0 of that"
    )
    del by_name[DDS + FIFO, "quiet"], by_name[DDS + FIFO, "busy"]
    assert share(by_name).startswith("Quiet: 10 us; T2 takes × 2.0 of that.")
