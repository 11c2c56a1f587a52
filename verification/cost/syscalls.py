"""System calls of a real bridge process for one velocity frame.

``strace -c`` would include periodic ticks and Zenoh's threads. So only the bridge's own thread is
traced, and split at its ``epoll_wait``; the count is the mode of the turns with one velocity frame.
Calls that wake Zenoh's threads are left out: their number depends on how deep the threads sleep.
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
from services.bridge.guard_ipc import Inherited
from services.bridge.udp import Sockets
from verification.cost.ledger import UncountableError
from verification.harness.bus import bus_on, router_process, running
from verification.harness.ports import free_port

FRAMES = 200
ENOUGH = 10  # turns with one frame only
LOST_S = 0.2  # then the next frame is sent: the bus was not connected
PAUSE_S = 0.002  # until the threads sleep
PATIENCE_S = 60.0
TURN = re.compile(r"^epoll_wait\(.*$", re.MULTILINE)
READ = re.compile(r"^recvmsg\(.* = (\d+)$", re.MULTILINE)
WAKING = re.compile(r"^(futex\(|write\(\d+, \"\\1(\\0){7}\", 8\)).*\n", re.MULTILINE)
VELOCITY_BYTES = "12"  # unique among the board's frames


def system_calls() -> dict[str, float]:
    """Return the system calls of a velocity frame; raise ``UncountableError`` without strace."""
    if shutil.which("strace") is None:
        raise UncountableError("strace is not installed")
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "strace"
        watch(log)
        return {"bridge_velocity": per_frame(log.read_text(encoding="ascii"))}


def per_frame(log: str) -> float:
    """Return the mode of the system calls of turns with one velocity frame only."""
    turns = [turn.strip() for turn in TURN.split(WAKING.sub("", log))]
    took = [
        turn.count("\n") + 2  # the wait, and one line for each call
        for turn in turns[len(turns) // 2 :]  # the bus was connected by then
        if READ.findall(turn) == [VELOCITY_BYTES]
    ]
    if len(took) < ENOUGH:
        raise UncountableError(f"strace saw only {len(took)} turns with one frame")
    return statistics.mode(took)


def watch(log: Path) -> None:
    """Send frames to a bridge under strace, one at a time."""
    published = threading.Semaphore(0)

    def declare(bus: Bus) -> None:
        bus.subscribe(keys.VELOCITY, lambda _: published.release(), depth=64)

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
                through += published.acquire(timeout=LOST_S)
                time.sleep(PAUSE_S)


@contextmanager
def traced(made: tuple[str, int], ours: int, endpoint: str, log: Path) -> Iterator[None]:
    """Run the bridge as its guard starts it, with its own thread under strace."""
    sockets = Sockets(Board(port=made[1], listen_ports=(ours,)))
    guard, heartbeat = os.pipe()
    inherited = Inherited(tuple(s.fileno() for s in sockets.sockets), heartbeat)
    sets = (f"board.port={made[1]}", f"board.listen_ports={ours}", f"bus.connect={endpoint}")
    command = ["strace", "-o", str(log), sys.executable, "-m", "services.bridge.child",
               *(word for one in sets for word in ("--set", one))]  # fmt: skip
    process = subprocess.Popen(
        command,
        env=os.environ | inherited.environ(),
        pass_fds=inherited.descriptors,
        stderr=subprocess.DEVNULL,
    )
    os.close(heartbeat)
    try:
        yield
    finally:
        os.close(guard)  # without a guard the bridge stops and ends
        process.wait(20)
        sockets.close()
