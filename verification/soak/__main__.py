"""``python -m verification.soak``: laps with random faults and SIGKILL, and resource usage."""

import argparse
import socket
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path

from msgspec.structs import replace

from cli.__main__ import EXIT_CODES
from cli.demo import host_stalls
from cli.demo.command import (
    WORLD,
    free_ports,
    log_file,
    own_ports,
    prepare_folder,
    trace_file,
    traced,
)
from cli.demo.lap import PATIENT, QUICK
from cli.inspect.session import interruptible
from cli.run.supervisor import Supervisor
from cli.run.up import passed_on
from cli.settings import Everything
from common import child_process, log
from common.bus.bus import Bus
from common.cli_args import add_sources, sources
from common.config import load
from common.errors import LinkError, RobotError
from common.loop import Loop
from sim.sockets import Control
from verification.harness.process_stats import PROC
from verification.soak.driver import STEP_S
from verification.soak.record import Record, encoded
from verification.soak.runner import SoakRunner
from verification.soak.verdict import Limits, good, results

POLL_S = 0.05
WARM_UP_S = 60.0
LAP_S = {QUICK: 120.0, PATIENT: 240.0}  # a lap takes a third of that without faults
KILLS_PART = 0.4  # of the time; afterwards every process runs long enough to be judged
REST_S = 0.3  # beyond the leases, from a fault to the last command that moves


def main(argv: Sequence[str] | None = None) -> int:
    """Run the soak; return its exit code."""
    parser = argparse.ArgumentParser(prog="python -m verification.soak", description=__doc__)
    add_arguments(parser)
    options = parser.parse_args(argv)
    try:
        return run(options)
    except RobotError as error:
        print(f"soak: {error}", file=sys.stderr)
        return EXIT_CODES.get(type(error), 1)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("--minutes", type=_minutes, default=30.0, help="duration, 30")
    parser.add_argument("--seed", type=int, default=1, help="seed of the faults, 1")
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("out/soak"),
        metavar="DIR",
        help="folder for plot, trace and log",
    )
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Run the soak and print the results; 0 for success, 128 plus the number after a signal."""
    try:
        from verification.soak import plot
        from verification.soak.show import Show
    except ImportError as error:
        raise RobotError(
            f"the soak needs {error.name}; `make soak` installs it, or pip install -e '.[demo]'"
        ) from None
    if not (PROC / "self" / "stat").exists():
        raise RobotError("the soak needs /proc of Linux")
    options.no_sim, options.world = False, WORLD
    prepare_folder(options)
    stall_s = host_stalls.measured()
    pace = PATIENT if stall_s > host_stalls.LIMIT_S else QUICK
    (control,) = free_ports(socket.SOCK_DGRAM)
    options.sets = host_stalls.with_accepted_joined([
        *own_ports(), f"sim.control_port={control}", *host_stalls.settings(stall_s), *options.sets
    ])  # fmt: skip
    config = load(Everything, sources(options)).config
    log.configure(replace(config.log, level="error"), "soak")
    seconds = options.minutes * 60
    show = Show(seconds)
    if pace is PATIENT:
        show.line(host_stalls.warning(stall_s).replace("demo", "soak"))
    record = Record()
    interrupted = soak(options, config, pace is PATIENT, record, show.event)
    limits = Limits(min(WARM_UP_S, seconds / 10), LAP_S[pace], 2 * STEP_S[pace] + 15)
    rows = results(record, limits)
    (options.out / "samples.json").write_bytes(encoded(record))
    files = [options.out / "soak.png", options.out / "soak.svg"]
    plot.save(files, record)
    show.results(rows, files)
    if interrupted:
        return 128 + interrupted
    return 0 if good(rows) else 1


def soak(
    options: argparse.Namespace,
    config: Everything,
    patient: bool,
    record: Record,
    report: Callable[[str], None],
) -> int:
    """Supervise the processes until the time is over; return a signal or 0."""
    began_s, seconds = time.monotonic(), options.minutes * 60
    commands = [*traced(options), ("driver", driver_command(options, patient))]
    with (
        closing(Loop()) as loop,
        closing(Bus(config.bus, config.robot.id, loop.post)) as bus,
        log_file(options).open("wb") as output,
        interruptible(loop) as signals,
    ):
        supervisor = Supervisor(commands, output)
        runner = SoakRunner(
            supervisor, Control(config.sim.control_port, timeout_s=1.0), record,
            files=(log_file(options), trace_file(options)), seed=options.seed,
            budget_s=budget_s(config), report=report, take_lateness_s=loop.take_lateness_s,
        )  # fmt: skip

        def step(now_ns: int) -> None:
            if supervisor.look(time.monotonic()):
                raise LinkError(f"a process does not run; see {output.name}")
            past_s = time.monotonic() - began_s
            runner.disturb(now_ns, kills=past_s < KILLS_PART * seconds)
            if past_s > seconds:
                loop.stop()

        runner.subscribe(bus)
        bus.open()
        loop.every(POLL_S, step)
        loop.every(1.0, lambda _: runner.sample())
        try:
            loop.run()
            runner.sample()
        finally:
            supervisor.end()
    return signals[0] if signals else 0


def budget_s(config: Everything) -> float:
    """Return how long after a fault a command may move the vehicle, in seconds."""
    return max(config.bridge.lease, config.safety.sources["demo"].lease) + REST_S


def driver_command(options: argparse.Namespace, patient: bool) -> list[str]:
    """Return the command of the driver."""
    words = ["--patient"] if patient else []
    return child_process.command("verification.soak.driver", *words, *passed_on(options))


def _minutes(text: str) -> float:
    minutes = float(text)
    if not 0.1 <= minutes <= 7 * 24 * 60:
        raise argparse.ArgumentTypeError(f"{text} is not within 0.1..10080")
    return minutes


if __name__ == "__main__":
    sys.exit(main())
