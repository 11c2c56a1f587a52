"""``t2 demo``: a simulated T2 drives a lap through the real services."""

import argparse
import contextlib
import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import replace

from cli.demo import host_stalls
from cli.inspect import output
from cli.run.supervisor import Supervisor
from cli.run.up import commands
from cli.settings import Everything
from common import log
from common.cli_args import add_sources, sources
from common.config import load
from common.errors import ConfigError, LinkError, RobotError
from sim.config import add_profiles, load_model, load_plan

if TYPE_CHECKING:
    import t2
    from cli.demo.lap import Lap, Pace
    from t2.messages import Odometry

WORLD, LOG, TRACE = "office", "processes.log", "trace.jsonl"
TIMEOUT_S = 120.0  # a lap takes 40 s; scheduling stalls stop the vehicle now and then
POLL_S = 0.1
MARKS = {True: "ok", False: "WRONG", None: ""}


class LapEndedError(Exception):
    """The lap takes too long."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "--out", type=Path, default=Path("out"), metavar="DIR", help="for plot, trace and log"
    )
    add_profiles(parser)
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Drive the lap; return 0 if it is good."""
    try:
        from cli.demo import plot
        from cli.demo.lap import PATIENT, QUICK
        from cli.demo.score import good, read, results
    except ImportError as error:
        raise RobotError(
            f"the demo needs {error.name}; `make demo` installs it, or pip install -e '.[demo]'"
            " -e sdk"
        ) from None
    options.no_sim, options.world = False, WORLD
    load_model(options.profile)  # refuses an invalid one before anything starts
    log_file, trace_file = prepared(options.out)
    stall_s = host_stalls.measured()
    options.sets = host_stalls.with_accepted_joined(
        [*own_ports(), *host_stalls.settings(stall_s), *options.sets]
    )
    config = load(Everything, sources(options)).config
    log.configure(replace(config.log, level="error"), "demo")
    pace = QUICK
    if stall_s > host_stalls.LIMIT_S:
        pace = PATIENT
        print(
            f"This host has scheduling stalls of up to {stall_s:.2f} s. "
            "The demo uses longer time limits and drives slower."
        )
    odometry: list[Odometry] = []
    lap = drive(options, config, pace, odometry)
    trace = read(trace_file) if trace_file.exists() else None
    if trace is None or not trace.truth:
        raise LinkError(f"the simulated vehicle did not run; see {log_file}")
    rows = results(trace, odometry, lap)
    body = [(what, amount, MARKS[fine]) for what, amount, fine in rows]
    print(f"\n{output.table(('the lap', 'result', ''), body)}")
    file = options.out / "lap.png"
    plot.save(file, load_plan(WORLD, config.vehicle), config.vehicle, trace, odometry)
    print(f"\nplot: {file}")
    return 0 if good(rows) else 1


def drive(
    options: argparse.Namespace, config: Everything, pace: "Pace", odometry: "list[Odometry]"
) -> "Lap":
    """Run the processes and drive the lap; ``odometry`` receives the poses."""
    from cli.demo.lap import Lap

    end_s, log_file = time.monotonic() + TIMEOUT_S, options.out / LOG
    with log_file.open("wb") as written, contextlib.ExitStack() as ends:
        processes = dict(commands(options))
        processes["sim"] = [*processes["sim"], "--trace", str(options.out / TRACE)]
        supervisor = Supervisor([*processes.items()], written)
        ends.callback(supervisor.end)

        def check() -> None:
            if supervisor.look(time.monotonic()):
                raise LinkError(f"a process cannot run; see {log_file}")
            if time.monotonic() > end_s:
                raise LapEndedError

        print("starting simulator, router, bridge, safety and odometry", flush=True)
        # Its session closes before the processes end: the last requests are zeros.
        robot = ends.enter_context(connected(config, check))
        robot.odometry.on(odometry.append)
        lap = Lap(
            robot,
            pace,
            show=lambda step, answer: print(f"    {answer}" if answer else f"  {step}", flush=True),
            check=check,
        )
        with contextlib.suppress(LapEndedError):
            lap.drive()
    return lap


def connected(config: Everything, check: Callable[[], None]) -> "t2.Robot":
    """Connect as soon as the router runs; ``check`` raises when it never will."""
    import t2

    while True:
        check()
        try:
            return t2.connect(config.robot.id, endpoint=config.bus.endpoints[0])
        except t2.LinkError:
            time.sleep(POLL_S)


def prepared(out: Path) -> tuple[Path, Path]:
    """Create the output folder; return its log, empty, and its trace, deleted."""
    log_file, trace_file = out / LOG, out / TRACE
    try:
        out.mkdir(parents=True, exist_ok=True)
        log_file.write_bytes(b"")
        trace_file.unlink(missing_ok=True)
    except OSError as error:
        raise ConfigError(f"--out {out}: cannot be written: {error.strerror}") from None
    return log_file, trace_file


def own_ports() -> list[str]:
    """Return settings with free ports, so that the demo can run beside ``t2 up``."""
    with contextlib.ExitStack() as stack:
        ports = []
        for kind in (*[socket.SOCK_DGRAM] * 3, socket.SOCK_STREAM):
            sock = stack.enter_context(socket.socket(socket.AF_INET, kind))
            sock.bind(("127.0.0.1", 0))
            ports.append(sock.getsockname()[1])
    board, first, second, router = ports
    return [
        f"board.port={board}",
        f"board.listen_ports=[{first}, {second}]",
        "board.address=127.0.0.1",
        "board.listen_address=127.0.0.1",
        f"bus.listen=tcp/127.0.0.1:{router}",
        "bus.connect=",
    ]
