"""Benchmarks ``command`` and ``telemetry``: every row works, and the tables of made-up samples."""

import itertools
import shutil
import socket
import threading
from pathlib import Path

import pytest

from bench.adapters.buses import POOLED
from bench.adapters.protocols import STAMP, packed, stamped, unpacked
from bench.command import measure as command
from bench.path import page, rows
from bench.path.vehicle import FRAMING, MOTIONS, SPEEDS_MMPS, VELOCITIES, compiled, free_ports
from bench.reaction import loop
from bench.series import Series
from bench.telemetry import measure as telemetry
from bench.telemetry.page import AGE, STREAMS, ages
from bench.telemetry.page import blocks as telemetry_blocks
from common import clock

BENCHMARKS = {"command": command.ROWS, "telemetry": telemetry.ROWS}
LOST = -1
# One of each kind; the others differ in an argument.
TRIED = (page.FLOOR, "T2", "T2, mutual TLS", POOLED.title)
EACH = [
    (part, row) for part, all_rows in BENCHMARKS.items() for row in all_rows if row.name in TRIED
]

wants_cc = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")


def test_the_one_process_has_the_frames_of_the_bridge() -> None:
    sent = [loop.command(loop.RUN, mmps) for mmps in SPEEDS_MMPS]
    assert sent == [FRAMING.pack(motion) for motion in MOTIONS]
    received = [loop.velocity(FRAMING.pack(frame)) for frame in VELOCITIES]
    assert received == [(0.0, 0.0), (0.001, 0.0), (0.002, 0.0)]
    assert loop.velocity(FRAMING.pack(VELOCITIES[0])[:-1]) is None


def test_a_twist_survives_encoding() -> None:
    assert unpacked(packed(0.1, -0.5)) == (0.1, -0.5)


def test_a_stamp_is_nine_bytes_as_the_vehicle_reads_them() -> None:
    assert stamped(2, 3) == b"\2\3" + bytes(7)
    assert STAMP.size == 9


@wants_cc
@pytest.mark.campaign
@pytest.mark.parametrize(("part", "row"), EACH, ids=[f"{part}: {row.name}" for part, row in EACH])
def test_each_row_passes_rounds(part: str, row: rows.Row, tmp_path: Path) -> None:
    if row.lacks:
        pytest.skip(f"{row.lacks} is not installed; `make bench` wants it")
    taken_ns = rows.block(compiled(tmp_path), row, 3, requests=part == "command")
    assert len(taken_ns) == 3
    assert max(taken_ns) > 0  # a loaded host may lose one
    assert all(ns == LOST or 0 < ns < 1e9 for ns in taken_ns)


@wants_cc
@pytest.mark.campaign
def test_a_lost_round_is_reported_and_another_follows(tmp_path: Path) -> None:
    ports = free_ports(requests=False)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", ports.to))
        consumer = threading.Thread(target=consume, args=(sock, ports.witness))
        consumer.start()
        try:
            _, lost, _ = compiled(tmp_path).timed(
                ports, 3, 0
            )  # raises when no further round passes
        finally:
            sock.sendto(b"", sock.getsockname())
            consumer.join()
    assert lost == LOST


def consume(sock: socket.socket, witness: int) -> None:
    """Consume, but miss the first ONE after a TWO; an empty datagram ends it."""
    frames = [FRAMING.pack(frame) for frame in VELOCITIES]
    early, missed = True, False
    while datagram := sock.recv(2048):
        kind = frames.index(datagram)
        early = early and kind != 2
        if kind == 1 and not early and not missed:
            missed = True
        else:
            sock.sendto(stamped(kind, clock.now_ns()), ("127.0.0.1", witness))


@wants_cc
@pytest.mark.campaign
def test_sample_ages_of_a_running_stack() -> None:
    made = telemetry.ages("quiet", 20)
    assert [one.name for one in made] == [(name, AGE, "quiet") for name, _, __ in STREAMS]
    for one in made:
        assert len(one.samples_ns) == 20
        assert all(0 < ns < 1e10 for ns in one.samples_ns)


def made_up(*name: str, times_us: int = 10) -> Series:
    return Series(name=name, samples_ns=[1000 * times_us] * 9 + [2000 * times_us])


def path() -> list[Series]:
    return [made_up(page.FLOOR, load) for load in ("quiet", "busy")] + [
        made_up("T2", load, times_us=30) for load in ("quiet", "busy")
    ]


def test_a_row_is_compared_with_the_floor() -> None:
    found = page.blocks(path())
    assert (
        found["table"].splitlines()[3] == "| T2 | 30 | 60 | 60 | × 3.0 | 30 | 60 | 60 | × 3.0 |  |"
    )
    assert found["samples"] == "10"


def test_t2_is_compared_with_zenoh_of_one_pool() -> None:
    assert page.targets(path()) == []
    beside = [made_up(POOLED.title, load, times_us=12) for load in ("quiet", "busy")]
    assert [target.verdict for target in page.targets(path() + beside)] == ["not reached"] * 2


def test_lost_rounds_are_no_samples_and_are_named() -> None:
    row = rows.series(("T2", "busy"), [1, -1, 3])
    assert row.samples_ns == [1, 3]
    assert page.lost([row, made_up("T2", "quiet")]).endswith(": T2, busy: 1 of 3.")
    assert page.lost([made_up("T2", "quiet")]).endswith(": none.")


def test_each_row_runs_under_both_loads() -> None:
    order = rows.order(command.ROWS, 2)
    assert len(order) == 4 * len(command.ROWS)
    assert set(order[: len(order) // 2]) == set(itertools.product(command.ROWS, ("quiet", "busy")))
    assert order == rows.order(command.ROWS, 2)


def aged() -> list[Series]:
    return [
        made_up(name, AGE, load, times_us=1500)
        for name, *_ in STREAMS
        for load in ("quiet", "busy")
    ]


def test_ages_are_compared_with_the_limits() -> None:
    lines = ages({one.name: one for one in aged()}).splitlines()
    assert lines[2] == (
        "| velocity | 50 | 1.5 | 3.0 | 3.0 | 1.5 | 3.0 | 3.0 | 200 | 2 of 2 reached |"
    )
    assert [line.split(" | ")[-2] for line in lines[3:]] == ["300", "150"]


def test_ages_are_not_rows_of_the_path() -> None:
    found = telemetry_blocks([*path(), *aged()])
    assert found["decisions"] == "10"
    assert len(found["table"].splitlines()) == 4
