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
    made = {one.name: one for one in throughput.measure(program, [2], [100], 0.3)}
    name = "frames", "2", "100"
    assert len(made[*name, "delay"].samples_ns) == 2 * 30
    assert set(made) == {
        (*name, candidate) for candidate in ("delay", "router", "bridge", "machine")
    }


@CC
@pytest.mark.campaign
def test_both_are_measured_in_turns(program: Path) -> None:
    by_name = {one.name: one for one in cost.measure(program, turns=1, seconds=0.3)}
    chain = {name[2] for name in by_name if name[0] == page.CHAIN}
    assert chain == {"router", "guard", "bridge", "safety", "odom", page.TOGETHER}
    for candidate in (page.CHAIN, page.BARE, page.BUS):
        for what in ("tenfold", "rss", "pss"):
            assert page.middle(by_name, candidate, what, page.TOGETHER) > 0
    assert page.cost(by_name).count("\n") == 1 + len(chain) + 3 + 4


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
            yield {"it": process.pid}, lambda: process.communicate() is not None

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
    blocks = page.blocks(made_up())
    _, _, one, five, twenty = blocks["throughput"].splitlines()
    assert one == "| 1 | 6,000 | 400 | 400 | 25 | 25 | 25 | 8,000 | 9 in the socket |"
    assert five.endswith("| 2,000 | 7 in the socket |")
    assert twenty == "| 20 | 0 | - | - | - | - | - | 500 | much |"
    assert blocks["throughput_verdict"].splitlines() == [
        "- to 1 consumer: 6,000 of 5,000 frames/s: reached",
        "- to 5 consumers: 1,000 of 5,000 frames/s: not reached",
        "- to 20 consumers: 0 of 5,000 frames/s: not reached",
    ]


def test_cost_is_compared_with_the_two_processes() -> None:
    blocks = page.blocks(made_up())
    assert blocks["turns"] == "3"
    assert blocks["cost"].splitlines()[4] == "| T2 | together | 6.0 | 60.0 | 180 | 60 |"
    assert blocks["cost_verdict"].splitlines() == [
        f"- CPU at the shipped rates beside {page.BARE}: × 1.5 of × 1.5: reached",
        f"  - {page.BUS}: × 1.2",
        f"- CPU at tenfold beside {page.BARE}: × 1.5 of × 1.5: reached",
        f"  - {page.BUS}: × 1.2",
        "- memory together, PSS (shared pages once): 60 of 150 MB: reached",
        "- memory together, RSS (shared pages in each): 180 of 150 MB: not reached",
    ]
