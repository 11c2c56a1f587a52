"""Black-box rows: shipped processes, an independent board, plain Zenoh clients.

Each row has its own stack. A row that fails while the host stalls is tried again.
"""

import contextlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from common import clock
from common.freshness import NS_PER_S
from verification.faults.independent_board import Command, IndependentBoard
from verification.faults.independent_client import LINK, MOTION, Client, Source, session
from verification.harness.bus import set_options
from verification.harness.host import StallRecorder
from verification.harness.ports import free_port, udp_ports
from verification.harness.waiting import becomes_true, wait_until

HEAD = ["scenario", "given", "when", "then", "on", ""]

TRIES, STALL_S = 3, 0.06
BRAKE_S = 0.1
UNDER_WAY_S = 0.15  # a RUN that was sent before a stop may arrive later
READY_S = 0.6  # safety needs good inputs for 0.5 s before a neutral request
NEUTRAL_S = 0.3
MODULES = "cli router", "services.bridge", "services.safety", "services.odom"


@dataclass
class BlackBox:
    """Access of a scenario to the board, a client and the processes."""

    board: IndependentBoard
    client: Client
    endpoint: str
    processes: dict[str, "subprocess.Popen[bytes]"]

    def armed(self) -> None:
        """Wait until bridge and safety accept a neutral request."""
        wait_until(lambda: self.client.last(LINK).get("armed"), f"armed: {self.client.last(LINK)}")
        wait_until(lambda: self.client.state.get("verdict", "inhibited") != "inhibited", "inputs")
        time.sleep(READY_S)

    @contextlib.contextmanager
    def source(self, name: str = "drive/teleop") -> Iterator[Source]:
        """Run a source; one that drives has made its neutral request."""
        with contextlib.closing(Source(self.client, f"@cmd/{name}")) as source:
            if name.startswith("drive/"):
                self.armed()
                source.repeat(linear=0.0, angular=0.0)
                time.sleep(NEUTRAL_S)
            yield source

    @contextlib.contextmanager
    def driving(self, linear: float) -> Iterator[Source]:
        """Drive straight on at a speed."""
        with self.source() as source:
            self.drive(source, linear)
            yield source

    def drive(self, source: Source, linear: float, angular: float = 0.0) -> None:
        """Drive at these speeds; after a stop of a loaded host, begin with neutral again."""
        board = self.board
        for _ in range(TRIES):
            source.repeat(linear=linear, angular=angular)
            if becomes_true(
                lambda: abs(board.linear - linear) + abs(board.angular - angular) < 0.04, 4.0
            ):
                return
            source.repeat(linear=0.0, angular=0.0)
            self.armed()
        raise AssertionError(f"not driven at {linear}, {angular}: {self.client.state.get('text')}")

    def runs(self, since_s: float) -> list[Command]:
        """Return the commands that move the vehicle, since a time."""
        return [command for command in self.board.since(since_s) if command.moves]

    def no_run(self, since_s: float) -> None:
        """Require that no command moved the vehicle since a time."""
        runs = self.runs(since_s)
        assert not runs, f"{len(runs)} RUN, the last {runs[-1].at_s - since_s:.2f} s later"

    def brakes(self, since_s: float, limit_s: float = BRAKE_S) -> None:
        """Require BRAKE within a limit."""
        took_s = self.first("brake", since_s, limit_s + 1.0) - since_s
        assert took_s <= limit_s, f"BRAKE after {took_s:.3f} s, {limit_s:.2f} s are allowed"

    def first(self, kind: str, since_s: float, patience_s: float) -> float:
        """Return the time of the first command of a kind since a time."""

        def found() -> list[Command]:
            return [command for command in self.board.since(since_s) if command.kind == kind]

        becomes_true(found, patience_s)
        assert found(), f"no {kind.upper()}: {self.client.state.get('text')}"
        return found()[0].at_s


@dataclass(frozen=True)
class Scenario:
    """A row: raises AssertionError with a sentence when it is not as expected."""

    given: str
    when: str
    then: str
    run: Callable[[BlackBox], None]
    sets: Sequence[str]

    @property
    def name(self) -> str:
        """The name in the table."""
        return self.run.__name__.replace("_", " ")

    def line(self, error: str, date: str) -> str:
        """Return the row of the page's table."""
        cells = [self.name, self.given, self.when, self.then, date, "WRONG" if error else "ok"]
        return f"| {' | '.join(cells)} |"


@contextlib.contextmanager
def black_box(sets: Sequence[str] = ()) -> Iterator[BlackBox]:
    """Run board, processes and client."""
    port, first, second = udp_ports(3)
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    words = set_options(
        f"bus.listen={endpoint}", f"board.port={port}", f"board.listen_ports=[{first}, {second}]",
        *sets,
    )  # fmt: skip
    with contextlib.ExitStack() as ends:
        folder = ends.enter_context(tempfile.TemporaryDirectory())
        log = ends.enter_context((Path(folder) / "log").open("wb"))
        board = ends.enter_context(contextlib.closing(IndependentBoard(port, (first, second))))
        # The runtime directory has the sockets of the processes: each run has its own.
        env = {**os.environ, "XDG_RUNTIME_DIR": folder}
        processes: dict[str, subprocess.Popen[bytes]] = {}
        for module in MODULES:
            process = subprocess.Popen(
                [sys.executable, "-m", *module.split(), *words], env=env, stdout=log, stderr=log
            )
            processes[module] = ends.enter_context(process)
            ends.callback(process.kill)
        client = Client(ends.enter_context(session(endpoint)), "tel/**", MOTION)
        wait_until(lambda: client.state and client.last(LINK), "services up")
        yield BlackBox(board, client, endpoint, processes)


def tried(one: Scenario, stalls: StallRecorder) -> str:
    """Run a scenario; return what is not as expected, empty when all is."""
    error = ""
    for _ in range(TRIES):
        begin_ns = clock.now_ns()
        try:
            with black_box(one.sets) as box:
                one.run(box)
            return ""
        except AssertionError as failed:
            error = str(failed)
        if stalls.worst_s(begin_ns, (clock.now_ns() - begin_ns) / NS_PER_S) < STALL_S:
            break
    return error
