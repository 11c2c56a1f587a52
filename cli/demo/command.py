"""``t2 demo``: a simulated T2 drives a lap through the real services."""

import argparse
import contextlib
import socket
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import replace

from cli.demo import host_stalls
from cli.inspect.session import interruptible
from cli.run.supervisor import Supervisor
from cli.run.up import commands
from cli.settings import Everything
from common import log
from common.cli_args import add_sources, sources
from common.config import load
from common.errors import ConfigError, LinkError, RobotError
from common.loop import Loop
from sim.config import add_profiles, load_model, load_plan

if TYPE_CHECKING:
    from cli.demo.lap_thread import LapThread

WORLD = "office"
TIMEOUT_S = 120.0  # a lap takes 40 s; scheduling stalls stop the vehicle now and then
POLL_S, DRAW_S = 0.1, 0.125


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("--fast", action="store_true", help="end before the drive home, no plot")
    parser.add_argument(
        "--out", type=Path, default=Path("out"), metavar="DIR", help="for plot, trace and log"
    )
    add_profiles(parser)
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Drive the lap; return 0 if it is good, 128 plus the signal's number after a signal."""
    try:
        from cli.demo.display import LapDisplay
        from cli.demo.lap import PATIENT, QUICK, drive_lap
        from cli.demo.lap_thread import LapThread
        from cli.demo.record import LapRecord
        from cli.demo.score import good, read, results
    except ImportError as error:
        raise RobotError(
            f"the demo needs {error.name}; `make demo` installs it, or pip install -e '.[demo]'"
            " -e sdk"
        ) from None
    options.no_sim, options.world = False, WORLD
    load_model(options.profile)  # refuses an invalid one before anything starts
    prepare_folder(options)
    stall_s = host_stalls.measured()
    options.sets = host_stalls.with_accepted_joined(
        [*own_ports(), *host_stalls.settings(stall_s), *options.sets]
    )
    config = load(Everything, sources(options)).config
    # The processes log to a file; on the terminal it would destroy the live display.
    log.configure(replace(config.log, level="error"), "demo")
    is_stalling = stall_s > host_stalls.LIMIT_S
    pace = PATIENT if is_stalling else QUICK
    plan, record = load_plan(WORLD, config.vehicle), LapRecord()
    lap = LapThread(
        lambda driver: drive_lap(driver, pace, fast=options.fast),
        record, config.robot.id, config.bus.endpoints[0],
    )  # fmt: skip
    with LapDisplay(plan, config.vehicle, options.out) as display:
        if is_stalling:
            display.show(host_stalls.warning(stall_s))
        record.on_step = display.step
        interrupted = drive(options, lap, lambda: display.draw(record, time.monotonic()))
    if interrupted:
        return 128 + interrupted
    trace = read(trace_file(options)) if trace_file(options).exists() else None
    if trace is None or not trace.truth:
        raise LinkError(f"the simulated vehicle did not run; see {log_file(options)}")
    rows = results(trace, record, options.fast)
    if not options.fast:
        display.plot(trace, record.odometry)
    display.results(rows, record)
    return 0 if good(rows) else 1


def drive(options: argparse.Namespace, lap: "LapThread", draw: Callable[[], None]) -> int:
    """Run the processes until the end of the lap or the timeout; return a signal or 0."""
    end_s = time.monotonic() + TIMEOUT_S
    with (
        log_file(options).open("wb") as output,
        closing(Loop()) as loop,
        interruptible(loop) as signals,
        contextlib.ExitStack() as ends,
    ):
        supervisor = Supervisor(traced(options), output)
        ends.callback(supervisor.end)

        def poll(_: int) -> None:
            if supervisor.look(time.monotonic()):
                raise LinkError(f"a process cannot run; see {output.name}")
            if not lap.is_alive() or time.monotonic() > end_s:
                loop.stop()

        lap.start()
        ends.callback(lap.end)  # before the processes end: the last requests are zeros
        loop.every(POLL_S, poll)
        loop.every(DRAW_S, lambda _: draw())
        loop.run()
    return signals[0] if signals else 0


def prepare_folder(options: argparse.Namespace) -> None:
    """Create the output folder, and delete the trace of an earlier lap."""
    try:
        options.out.mkdir(parents=True, exist_ok=True)
        log_file(options).write_bytes(b"")
        trace_file(options).unlink(missing_ok=True)
    except OSError as error:
        raise ConfigError(f"--out {options.out}: cannot be written: {error.strerror}") from None


def traced(options: argparse.Namespace) -> list[tuple[str, list[str]]]:
    """Return the processes of ``t2 up``, with a simulator that writes a trace."""
    trace = ["--trace", str(trace_file(options))]
    return [
        (name, [*command, *(trace if name == "sim" else [])]) for name, command in commands(options)
    ]


def trace_file(options: argparse.Namespace) -> Path:
    """Return the file of the simulator's trace."""
    out: Path = options.out
    return out / "trace.jsonl"


def log_file(options: argparse.Namespace) -> Path:
    """Return the log file of the processes."""
    out: Path = options.out
    return out / "processes.log"


def own_ports() -> list[str]:
    """Return settings with separate ports, so that the demo can run beside ``t2 up``."""
    board, first, second, router = free_ports(*[socket.SOCK_DGRAM] * 3, socket.SOCK_STREAM)
    return [
        f"board.port={board}",
        f"board.listen_ports=[{first}, {second}]",
        "board.address=127.0.0.1",
        "board.listen_address=127.0.0.1",
        f"bus.listen=tcp/127.0.0.1:{router}",
        "bus.connect=",
    ]


def free_ports(*kinds: socket.SocketKind) -> list[int]:
    """Return different free ports of 127.0.0.1."""
    with contextlib.ExitStack() as stack:
        socks = [stack.enter_context(socket.socket(socket.AF_INET, kind)) for kind in kinds]
        for sock in socks:
            sock.bind(("127.0.0.1", 0))
        return [sock.getsockname()[1] for sock in socks]
