"""Run the simulated vehicle: main board and world, until ctrl-c."""

import argparse
import os
import signal
import sys
from collections.abc import Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import BinaryIO

import msgspec

from common import clock, log, realtime
from common.bus.bus import Bus
from common.cli_args import add_sources, file_path, run_program, sources
from common.config import load
from common.errors import ConfigError
from common.freshness import NS_PER_S
from common.log import Logger
from common.loop import Loop
from sim.config import Config, add_profiles, load_model, load_plan, profile_list
from sim.localizer import Localizer
from sim.model import Model
from sim.simulation import STEP_NS, Simulation
from sim.sockets import HOST, BoardSocket, answer_requests, bound
from sim.world import Plan


def trace_file(path: Path) -> BinaryIO:
    """Open the file of the trace, unbuffered; raise ``ConfigError`` if it cannot be written."""
    try:
        return path.open("wb", buffering=0)
    except OSError as error:
        raise ConfigError(f"--trace {path}: cannot be written: {error.strerror}") from None


class Process:
    """Sockets, clock and trace around the simulation; the constructor opens the sockets."""

    def __init__(self, config: Config, model: Model, plan: Plan, trace: BinaryIO) -> None:
        ports = config.board.listen_ports
        self.simulation = Simulation(model, plan, clock.now_ns(), config.sim.seed, ports)
        self._trace = trace
        with ExitStack() as stack:  # closes opened sockets when a later port is taken
            self.loop = stack.enter_context(closing(Loop()))
            self._board = BoardSocket(config.board)
            self.loop.watch(stack.enter_context(self._board.sock), self._receive)
            if config.sim.control_port:
                self._control = bound(HOST, config.sim.control_port, "sim.control_port")
                self.loop.watch(stack.enter_context(self._control), self._serve_control)
            self._localizer = self._localize(config, stack) if config.sim.fix_source else None
            self._opened = stack.pop_all()
        self.loop.every(STEP_NS / NS_PER_S, self._step)

    def _localize(self, config: Config, stack: ExitStack) -> Localizer:
        bus = Bus(config.bus, config.robot.id, self.loop.post)
        localizer = Localizer(bus, config.sim, self.simulation.truth)
        bus.open()
        stack.callback(bus.close)
        return localizer

    def run(self) -> None:
        """Run until the loop is stopped."""
        self.loop.run()
        counters = dict(self.simulation.counters)
        Logger().info("stopped", unsent=self._board.unsent, **counters)

    def close(self) -> None:
        """Close ports and descriptors."""
        self._opened.close()

    def _step(self, now_ns: int) -> None:
        self.simulation.advance(now_ns)
        self._deliver()
        if self._localizer is not None:
            self._localizer.step(now_ns)

    def _receive(self, now_ns: int) -> None:
        # Advance first, so that answers are current even after a stall of this process.
        self.simulation.advance(now_ns)
        for payload, port in self._board.receive():
            self.simulation.receive(payload, port, now_ns)
        self._deliver()

    def _serve_control(self, now_ns: int) -> None:
        answer_requests(self._control, self.simulation, now_ns)
        self._deliver()

    def _deliver(self) -> None:
        now_ns = clock.now_ns()
        for datagram in self.simulation.take_sent(now_ns):
            self._board.send(datagram)
        for line in self.simulation.take_records():
            self._trace.write(msgspec.json.encode(line) + b"\n")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the simulator's options."""
    parser.add_argument("--world", help="name of a file in sim/worlds, or path of a TOML file")
    add_profiles(parser)
    parser.add_argument("--list-profiles", action="store_true", help="list the profiles and end")
    parser.add_argument(
        "--trace", type=file_path, default=os.devnull, metavar="FILE", help="write a trace file"
    )
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Simulate until SIGINT or SIGTERM; raise ``ConfigError`` or ``LinkError`` at the start."""
    if options.list_profiles:
        print(profile_list())
        return 0
    world = [f"sim.world={options.world}"] if options.world is not None else []
    options.sets = [*options.sets, *world]
    config = load(Config, sources(options)).config
    model = load_model(options.profile, Model(wire=config.wire, vehicle=config.vehicle))
    plan = load_plan(config.sim.world, model.vehicle)
    if config.host.realtime:
        realtime.request(realtime.BOARD)
    log.configure(config.log, "sim")
    with (
        trace_file(options.trace) as trace,
        closing(Process(config, model, plan, trace)) as process,
    ):
        for name in (signal.SIGINT, signal.SIGTERM):
            signal.signal(name, lambda *_: process.loop.stop())
        Logger().info(
            "started",
            world=plan.title,
            profiles=options.profile,
            board=f"{config.board.address}:{config.board.port}",
        )
        process.run()
    return 0


def main(argv: Sequence[str] | None = None) -> int:
    """Run with these arguments and return the exit code."""
    return run_program("sim", add_arguments, run, argv, __doc__)


if __name__ == "__main__":
    sys.exit(main())
