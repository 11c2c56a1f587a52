"""Benchmark ``load``: small runs, and the tables of made-up samples."""

import contextlib
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from bench.load import cost, loss, page, throughput, two_processes
from bench.load.board import ANSWERS, FRAMING, STANDS, board, compiled
from bench.load.frames import read
from bench.load.loss import Passage
from bench.load.stack import Ports
from bench.series import Series
from common.wire import commands
from common.wire.framing import Received
from services.bridge.config import Bridge, queries
from tests.bench.load_series import made_up
from verification.harness.ports import free_port
from verification.harness.process_stats import CpuShares, memory, udp_drops
from verification.harness.waiting import wait_until

CC = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compiled(tmp_path_factory.mktemp("board"))


@pytest.fixture
def sock() -> Iterator[socket.socket]:
    """Socket of the board's reader."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.bind(("127.0.0.1", 0))
        made.settimeout(20.0)
        yield made


def bound(port: int) -> bool:
    try:
        return udp_drops(port) == 0
    except LookupError:
        return False


@CC
def test_the_board_sends_a_number_of_frames_and_answers(program: Path, sock: socket.socket) -> None:
    port = free_port(socket.SOCK_DGRAM)
    with board(program, port, sock.getsockname()[1], {STANDS: 0.0}) as it:
        wait_until(lambda: bound(port), "the board")
        for query, answer in ANSWERS.items():
            sock.sendto(FRAMING.pack(query), ("127.0.0.1", port))
            assert sock.recv(2048) == FRAMING.pack(answer)
        headers = 28 * len(ANSWERS)
        queries, answers = (
            headers + sum(len(FRAMING.pack(frame)) for frame in some)
            for some in (ANSWERS.keys(), ANSWERS.values())
        )
        assert it.counted() == (queries, answers)
        reached_hz = it.send(1000.0, 20)
        assert [sock.recv(2048) for _ in range(20)] == [FRAMING.pack(STANDS)] * 20
        assert 0 < reached_hz < 1100
        sock.setblocking(False)
        with pytest.raises(BlockingIOError):
            sock.recv(2048)


def test_the_two_processes_send_the_queries_of_the_bridge() -> None:
    asked = {FRAMING.pack(frame): rate_hz for _, frame, rate_hz in queries(Bridge())}
    assert asked == two_processes.QUERIES
    for query, answer in ANSWERS.items():
        frames = read(FRAMING.pack(answer), two_processes.KINDS)
        assert len(frames) == 1, query


def test_the_two_processes_query_read_and_drive(sock: socket.socket) -> None:
    port = free_port(socket.SOCK_DGRAM)
    words = "-m", "bench.load.two_processes", str(port), str(sock.getsockname()[1])
    with subprocess.Popen([sys.executable, *words]) as process:
        received: set[bytes] = set()
        while len(received) < len(two_processes.QUERIES) + 1:
            received.add(sock.recv(2048))
            sock.sendto(FRAMING.pack(STANDS), ("127.0.0.1", port))
        assert process.poll() is None
        process.kill()
    (command,) = received - set(two_processes.QUERIES)
    (part,) = FRAMING.read(command, commands.TO_BOARD)
    assert isinstance(part, Received)
    assert part.frame == commands.MotionCommand(commands.MotionKind.RUN, two_processes.SPEED_MMPS)


@CC
@pytest.mark.campaign
def test_frames_are_counted_through_the_bridge(program: Path) -> None:
    made = {one.name: one for one in throughput.measure(program, [1], [100], 0.3)}
    name = "frames", "1", "100"
    assert len(made[*name, "delay"].samples_ns) == 30
    assert set(made) == {
        (*name, candidate) for candidate in ("delay", "router", "bridge", "machine")
    }


@CC
@pytest.mark.campaign
@pytest.mark.parametrize("name", [page.OBSERVED, page.BARE, page.POOLED])
def test_each_candidate_is_measured(
    name: str, program: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cost, "CANDIDATES", {name: cost.CANDIDATES[name]})
    by_name = {one.name: one for one in cost.measure(program, turns=1, seconds=0.5)}
    processes = page.processes(by_name, name)
    for what in ("rss", "pss"):
        assert page.middle(by_name, name, what, page.TOGETHER) > 0
    assert page.middle(by_name, name, "bytes", page.TO_BRIDGE) > 1000
    assert page.middle(by_name, name, "bytes", page.TO_BOARD) > 1000
    if name == page.OBSERVED:
        assert set(processes) == {"router", "guard", "bridge", "safety", "odom", page.TOGETHER}
        assert page.middle(by_name, name, "bytes", page.CONSUMER) > 1000


def test_datagrams_that_the_kernel_drops_are_counted(sock: socket.socket) -> None:
    port = sock.getsockname()[1]
    before = udp_drops(port)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        for _ in range(100):
            other.sendto(b"x" * 1000, ("127.0.0.1", port))
    assert 0 < udp_drops(port) - before < 100
    with pytest.raises(LookupError):
        udp_drops(0)


def test_time_and_memory_of_a_process() -> None:
    waits = [sys.executable, "-c", "input()"]
    with (
        subprocess.Popen(waits, stdin=subprocess.PIPE) as other,
        CpuShares({"me": os.getpid(), "other": other.pid}) as shares,
    ):
        begin_s = time.process_time()
        while time.process_time() - begin_s < 0.1:
            pass
        other.communicate()
    assert shares.ns.keys() == {"me", "machine"}  # the other one has ended
    assert shares.ns["me"] > 0
    assert shares.ns["machine"] > 0
    of = memory(os.getpid())
    assert 0 < of["pss"] <= of["rss"]


@pytest.mark.parametrize(
    ("passage", "words"),
    [
        (Passage(100, 0, 100, [100, 100]), ""),
        (Passage(100, 7, 90, [90, 90]), "7 in the socket, 3 in the bridge"),
        (Passage(100, 7, 98, [98, 98]), "2 in the socket"),  # five of the dropped were answers
        (Passage(100, 0, 100, [97, 95]), "3 between bridge and consumers, 2 at single consumers"),
        (Passage(9000, 0, 9000, [1000]), "8,000 between bridge and consumers"),
        (Passage(100, 0, 100, [100], late_s=0.5), "0.5 s behind"),
        (Passage(100, 0, 100, [100], pace=0.9), "the board was at 90% of it"),
    ],
)
def test_places_of_losses(passage: Passage, words: str) -> None:
    assert passage.words == words


@CC
def test_a_turn_in_which_a_process_ends_is_empty(program: Path) -> None:
    @contextlib.contextmanager
    def ended(_: Ports) -> Iterator[cost.Running]:
        with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
            yield cost.Running({"it": process.pid}, lambda: process.communicate() is not None)

    assert cost.turn(program, ended, 0.0) == {}


def test_lateness_at_the_end_counts() -> None:
    ages_ns = [1_000_000] * 90 + [700_000_000] * 10
    assert throughput.late_s(ages_ns) == 0.7
    assert throughput.late_s([]) == 0.0


@pytest.mark.parametrize("most", [0, 1, 2, 5, 7, 8, 99])
def test_the_highest_rate_is_found(most: int) -> None:
    rates, tried = [1, 2, 3, 5, 8], []

    def holds(hz: int) -> bool:
        tried.append(hz)
        return hz <= most

    assert loss.highest(rates, holds) == max((hz for hz in rates if hz <= most), default=0)
    assert len(tried) <= 3


def test_a_rate_counts_when_no_lower_rate_lost_anything() -> None:
    made = made_up()
    _, _, one, five, twenty = page.blocks(made)["throughput"].splitlines()
    assert one == (
        "| 1 | 6,000 | 400 | 400 | 25 | 25 | 25 | 8,000 | 9 in the socket | 1 of 1 reached |"
    )
    assert five.endswith("| 2,000 | 7 in the socket |  |")
    assert twenty == "| 20 | 0 | - | - | - | - | - | 500 | much |  |"
    (target,) = page.throughput_targets(made)
    assert target.cells[1:] == ["5,000 frames/s", "× 1.20", "at least × 1", "reached"]


def test_cost_is_compared_with_the_two_processes() -> None:
    made = made_up()
    blocks = page.blocks(made)
    assert blocks["turns"] == "3"
    rows = blocks["cost"].splitlines()
    assert rows[4] == "| T2 | together | 6.0 | × 1.5 | 180 | 60 | 2 of 2 reached |"
    assert rows[5] == f"| {page.BARE} | together | 1.0 | × 0.2 | 30 | 10 |  |"
    assert [target.ratio for target in page.cost_targets(made)] == [1.5, 0.4]


def test_an_hour_has_cpu_seconds_and_bytes() -> None:
    rows = page.blocks(made_up())["hour"].splitlines()
    assert "| T2 | CPU, together | 216 s |" in rows
    assert f"| {page.OBSERVED} | CPU added to the router | 11 s |" in rows
    assert f"| {page.OBSERVED} | to the consumer | 36.0 MB |" in rows


def test_what_a_consumer_adds_is_compared_with_the_noise() -> None:
    turns = {page.CHAIN: [10, 12, 30], page.OBSERVED: [20, 24, 30]}
    by_name: dict[tuple[str, ...], Series] = {
        (name, "cpu", "router"): Series(name=("it",), samples_ns=[each * 10**6 for each in some])
        for name, some in turns.items()
    }
    assert page.added(by_name, "router") == "43 s, within noise"
