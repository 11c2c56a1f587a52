"""``t2 demo``: a simulated T2 drives a lap through the real services."""

import argparse
import contextlib
import shlex
import socket
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import replace

from cli.demo import host_stalls
from cli.inspect import output
from cli.run.supervisor import Supervisor
from cli.run.up import commands
from cli.settings import Everything
from common import log
from common.cli_args import add_sources, file_path, source_words, sources
from common.config import load
from common.errors import ConfigError
from sim.config import add_profiles, load_model, load_plan
from t2.errors import LinkError, T2Error

if TYPE_CHECKING:
    from t2.messages import Odometry

WORLD, LOG, TRACE = "office", "processes.log", "trace.jsonl"
TIMEOUT_S = 120.0  # a lap takes 40 s; scheduling stalls stop the vehicle now and then
POLL_S = 0.1
SLOW = 0.5  # on a host with scheduling stalls: measurements are old when the program acts on them


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "--out", type=file_path, default=Path("out"), metavar="DIR", help="for plot, trace and log"
    )
    add_profiles(parser)
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Drive the lap; return 0 if it is good."""
    try:
        from cli.demo import plot
        from cli.demo.score import good, read, results
    except ImportError as error:
        raise T2Error(
            f"the demo needs {error.name}; `make demo` installs it, or pip install -e '.[demo]'"
            " -e sdk"
        ) from None
    load_model(options.profile)  # refuses an invalid one before anything starts
    prepare(options.out)
    stall_s = host_stalls.measured()
    options.sets = host_stalls.with_overrides_joined(
        [*own_ports(), f"sim.world={WORLD}", *host_stalls.settings(stall_s), *options.sets]
    )
    config = load(Everything, sources(options)).config
    log.configure(replace(config.log, level="error"), "demo")
    odometry = drive(options, config, SLOW if stall_s > host_stalls.LIMIT_S else 1.0)
    trace = read(options.out / TRACE)
    rows = results(trace)
    body = [(what, amount, "ok" if fine else "WRONG") for what, amount, fine in rows]
    print(f"\n{output.table(('the lap', 'result', ''), body)}")
    file = options.out / "lap.png"
    plot.save(file, load_plan(WORLD, config.vehicle), config.vehicle, trace, odometry)
    print(f"\nplot: {shlex.quote(str(file))}")
    return 0 if good(rows) else 1


def drive(options: argparse.Namespace, config: Everything, pace: float) -> "list[Odometry]":
    """Run the processes and drive the lap; return the poses."""
    import t2
    from cli.demo.lap import Lap

    if pace < 1:
        print("This host has scheduling stalls: longer time limits, half the speed.")
    print("starting simulator, router, bridge, safety and odometry", flush=True)
    end_s, log_file = time.monotonic() + TIMEOUT_S, options.out / LOG
    odometry: list[Odometry] = []
    processes = commands(source_words(options), options.profile)
    processes["sim"] = [*processes["sim"], "--trace", str(options.out / TRACE)]
    with log_file.open("wb") as written, contextlib.ExitStack() as ends:
        supervisor = Supervisor(processes, written)
        ends.callback(supervisor.end)

        def check() -> None:
            if supervisor.look(time.monotonic()):
                raise LinkError(f"a process cannot run; see {log_file}")
            if time.monotonic() > end_s:
                raise T2Error(f"the lap takes longer than {TIMEOUT_S:g} s; see {log_file}")

        robot: t2.Robot | None = None
        while robot is None:  # until the router runs
            check()
            try:
                robot = t2.connect(config.robot.id, endpoint=config.bus.endpoints[0])
            except t2.LinkError:
                time.sleep(POLL_S)
        # Its session closes before the processes end: the last requests are zeros.
        ends.enter_context(robot)
        robot.odometry.on(odometry.append)
        Lap(robot, pace, show=partial(print, flush=True), check=check).drive()
    return odometry


def prepare(out: Path) -> None:
    """Create the output folder with an empty log and trace."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        for name in (LOG, TRACE):
            (out / name).write_bytes(b"")
    except OSError as error:
        raise ConfigError(f"--out {out}: cannot be written: {error.strerror}") from None


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
