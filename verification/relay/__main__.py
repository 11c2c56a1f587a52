"""``python -m verification.relay``: measure a reflex directly and through the relay, in turns.

Two real bridges run at once, one on a cable to the board and one behind a relay. The board reports
a hit and waits for BRAKE. Through the relay two of them arrive: the relay's own, then the bridge's.
Neither router nor safety runs: the reflex needs none.
"""

import argparse
import contextlib
import os
import select
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import median

from common import clock
from common.freshness import NS_PER_S
from services.relay.wire import BRAKE, BUMPER, frame
from verification.harness.bus import set_options
from verification.harness.ports import free_port
from verification.harness.results import table
from verification.harness.waiting import wait_until

DIRECT, BEHIND = (("127.78.0.1", "127.78.0.2"), ("127.78.1.1", "127.78.1.2"))  # PC, board
RELAY = "127.78.2.1", "127.78.2.2"  # to the PC, to the board
HIT, CLEAR = frame(BUMPER, b"\1"), frame(BUMPER, b"\0")
QUIET_S = 0.02  # between the clear samples and the hit
PATIENCE_S = 0.2
ADDED_MAX_S = 0.0003


class Board:
    """The board's socket, and where it sends to."""

    def __init__(self, own: tuple[str, int], to: tuple[str, int]) -> None:
        self._to = to
        self.sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.sock.bind(own)
        self.sock.settimeout(PATIENCE_S)

    def drain(self) -> list[bytes]:
        """Return what waits."""
        found = []
        while select.select([self.sock], [], [], 0.0)[0]:
            found.append(self.sock.recv(2048))
        return found

    def reflex_s(self, brakes: int) -> list[float]:
        """Report a hit; return the times until this many BRAKEs, in seconds."""
        for _ in range(4):
            self.sock.sendto(CLEAR, self._to)
            time.sleep(QUIET_S / 4)
        self.drain()
        at_ns = clock.now_ns()
        self.sock.sendto(HIT, self._to)
        found: list[float] = []
        while len(found) < brakes:
            if self.sock.recv(2048) == BRAKE:
                found.append((clock.now_ns() - at_ns) / NS_PER_S)
        return found


@contextlib.contextmanager
def running(folder: Path, *words: str) -> Iterator[None]:
    """Run a module."""
    env = {**os.environ, "XDG_RUNTIME_DIR": str(folder)}
    with (folder / "log").open("ab") as log:
        process = subprocess.Popen([sys.executable, "-m", *words], stderr=log, env=env)
    try:
        yield
    finally:
        process.terminate()
        process.wait(20)


@contextlib.contextmanager
def boards(folder: Path) -> Iterator[tuple[Board, Board]]:
    """Run both bridges and the relay; return the boards, the one behind the relay second."""
    (pc, board), (pc_behind, board_behind) = DIRECT, BEHIND
    port, ours, report, router = (free_port(socket.SOCK_DGRAM) for _ in range(4))
    common = [f"board.port={port}", f"board.listen_ports=[{ours}]",
              f"bus.connect=tcp/127.0.0.1:{router}"]  # fmt: skip
    direct = ["robot.id=direct", f"board.address={board}", f"board.listen_address={pc}"]
    behind = ["robot.id=behind", f"board.address={RELAY[0]}", f"board.listen_address={pc_behind}",
              f"board.relay_port={report}"]  # fmt: skip
    relay = ["--pc", pc_behind, "--pc-side", RELAY[0], "--board", board_behind,
             "--board-side", RELAY[1], "--board-port", str(port), "--ports", str(ours),
             "--report-port", str(report)]  # fmt: skip
    with contextlib.ExitStack() as stack:
        both = Board((board, port), (pc, ours)), Board((board_behind, port), (RELAY[1], ours))
        for each in both:
            stack.enter_context(each.sock)
        stack.enter_context(running(folder, "services.relay", *relay))
        for sets in (direct, behind):
            stack.enter_context(running(folder, "services.bridge", *set_options(*common, *sets)))
        for (
            each
        ) in both:  # BRAKE of the relay or the guard does not count: queries are the bridge's
            wait_until(lambda one=each: any(d != BRAKE for d in one.drain()), "a bridge", 30.0)  # type: ignore[misc]
        yield both


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, and print medians, differences and ratios; return 1 beyond the limit."""
    parser = argparse.ArgumentParser(prog="python -m verification.relay", description=__doc__)
    parser.add_argument("--trials", type=int, default=300, help="reflexes of each kind, 300")
    options = parser.parse_args(argv)
    times: dict[str, list[float]] = {"direct": [], "relay's own": [], "bridge's, by relay": []}
    with tempfile.TemporaryDirectory() as name, boards(Path(name)) as (direct, behind):
        for _ in range(options.trials):
            with contextlib.suppress(TimeoutError):
                (first,) = direct.reflex_s(1)
                own, through = behind.reflex_s(2)
                for kind, took in zip(times, (first, own, through), strict=True):
                    times[kind].append(took)
    base = median(times["direct"])
    rows = [
        [kind, str(len(took)), f"{median(took) * 1000:.3f}", f"{(median(took) - base) * 1000:+.3f}",
         f"{median(took) / base:.2f}"]
        for kind, took in times.items()
    ]  # fmt: skip
    print(table(("BRAKE", "n", "median, ms", "added, ms", "ratio"), rows))
    return int(min(median(took) for took in [*times.values()][1:]) - base > ADDED_MAX_S)


if __name__ == "__main__":
    sys.exit(main())
