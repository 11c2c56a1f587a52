"""System calls of a real bridge process, between waking for a frame and waiting for the next.

``strace -c`` would mix in the ticks and Zenoh's threads, which go by time. So only the bridge's own
thread is traced, and cut at its ``epoll_wait``; what most of the turns with one velocity frame took
is the count. How Zenoh wakes its threads is left out: that depends on how deep they sleep.
"""

import os
import re
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from common import keys
from common.bus.bus import Bus
from common.loop import Loop
from common.settings import Board
from common.wire.framing import Framing
from common.wire.reports import VelocityReport
from services.bridge.guard_ipc import Handover
from services.bridge.udp import Sockets
from verification.cost.uncountable import Uncountable
from verification.harness.bus import bus_on, router_process, running
from verification.harness.ports import free_port

FRAMES = 200
ENOUGH = 10  # turns with a frame alone
LOST_S = 0.2  # after which the next one is sent: there was no bus yet
PAUSE_S = 0.002  # for threads to fall asleep
PATIENCE_S = 60.0
TURN = re.compile(r"^epoll_wait\(.*$", re.MULTILINE)
READ = re.compile(r"^recvmsg\(.* = (\d+)$", re.MULTILINE)
WAKING = re.compile(r"^(futex\(|write\(\d+, \"\\1(\\0){7}\", 8\)).*\n", re.MULTILINE)
VELOCITY_BYTES = "12"  # of the board's frames no other has as many


def system_calls() -> dict[str, float]:
    """Return the system calls of a velocity frame; raise ``Uncountable`` without strace."""
    if shutil.which("strace") is None:
        raise Uncountable("strace is not installed")
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "strace"
        watch(log)
        return {"bridge_velocity": per_frame(log.read_text(encoding="ascii"))}


def per_frame(log: str) -> float:
    """Return what most of the turns took in which nothing came but one velocity frame."""
    turns = [turn.strip() for turn in TURN.split(WAKING.sub("", log))]
    took = [
        turn.count("\n") + 2  # the wait, and a line for each call after it
        for turn in turns[len(turns) // 2 :]  # there has been a bus for long
        if READ.findall(turn) == [VELOCITY_BYTES]
    ]
    if len(took) < ENOUGH:
        raise Uncountable(f"strace saw {len(took)} turns with a frame alone, too few to judge")
    return statistics.mode(took)


def watch(log: Path) -> None:
    """Let a bridge under strace take in frame after frame, each once the one before is through."""
    heard = threading.Semaphore(0)

    def declare(bus: Bus) -> None:
        bus.subscribe(keys.VELOCITY, lambda _: heard.release(), depth=64)

    endpoint = f"tcp/127.0.0.1:{free_port()}"
    frame = Framing().pack(VelocityReport(300, 0))
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made,
        router_process(endpoint),
        running(Loop()) as loop,
        bus_on(endpoint, loop, declare),
    ):
        made.bind(("127.0.0.1", 0))
        ours = free_port(socket.SOCK_DGRAM)
        deadline_s, through = time.monotonic() + PATIENCE_S, 0
        with traced(made.getsockname(), ours, endpoint, log):
            while through < FRAMES and time.monotonic() < deadline_s:
                made.sendto(frame, ("127.0.0.1", ours))
                through += heard.acquire(timeout=LOST_S)
                time.sleep(PAUSE_S)


@contextmanager
def traced(made: tuple[str, int], ours: int, endpoint: str, log: Path) -> Iterator[None]:
    """Run the bridge itself, as its guard would start it, with its own thread under strace."""
    sockets = Sockets(Board(port=made[1], listen_ports=(ours,)))
    guard, heartbeat = os.pipe()
    handover = Handover(tuple(s.fileno() for s in sockets.sockets), heartbeat)
    sets = (f"board.port={made[1]}", f"board.listen_ports={ours}", f"bus.connect={endpoint}")
    command = ["strace", "-o", str(log), sys.executable, "-m", "services.bridge.child",
               *(word for one in sets for word in ("--set", one))]  # fmt: skip
    process = subprocess.Popen(
        command,
        env=os.environ | handover.environ(),
        pass_fds=handover.descriptors,
        stderr=subprocess.DEVNULL,
    )
    os.close(heartbeat)
    try:
        yield
    finally:
        os.close(guard)  # a bridge that nobody guards stops and ends
        process.wait(20)
        sockets.close()
