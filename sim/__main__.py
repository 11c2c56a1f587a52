"""Run the simulated vehicle: main board and world, until ctrl-c."""

import argparse
import signal
import sys
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

from common import log, realtime
from common.cli_args import EXIT_CONFIG, EXIT_LINK, add_sources, sources
from common.config import load
from common.errors import ConfigError, LinkError
from sim.config import Config, add_profiles, load_model, load_plan, profile_list
from sim.model import Model
from sim.process import Process, Trace


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the simulator's options."""
    parser.add_argument("--world", help="name of a file in sim/worlds, or path of a TOML file")
    add_profiles(parser)
    parser.add_argument("--list-profiles", action="store_true", help="list the profiles and end")
    parser.add_argument("--trace", type=Path, metavar="FILE", help="write a trace file")
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Simulate until SIGINT or SIGTERM; raise ``ConfigError`` before anything opens."""
    if options.list_profiles:
        print(profile_list())
        return 0
    world = [f"sim.world={options.world}"] if options.world is not None else []
    options.sets = [*options.sets, *world]
    config = load(Config, sources(options)).config
    model = load_model(options.profile, Model(wire=config.wire, vehicle=config.vehicle))
    plan = load_plan(config.sim.world, model.vehicle)
    if config.robot.realtime:
        realtime.request(realtime.BOARD)
    log.configure(config.log, "sim")
    with closing(Trace(options.trace)) as trace:
        try:
            process = Process(config, model, plan, trace)
        except LinkError as error:
            log.Logger().error(str(error))
            return EXIT_LINK
        with closing(process):
            for name in (signal.SIGINT, signal.SIGTERM):
                signal.signal(name, lambda *_: process.loop.stop())
            log.Logger().info(
                "started",
                world=plan.title,
                profiles=options.profile,
                board=f"{config.board.address}:{config.board.port}",
            )
            process.run()
    return 0


def main(argv: Sequence[str] | None = None) -> int:
    """Run with these arguments and return the exit code."""
    parser = argparse.ArgumentParser(prog="sim", description=__doc__)
    add_arguments(parser)
    try:
        return run(parser.parse_args(argv))
    except ConfigError as error:
        print(f"sim: {error}", file=sys.stderr)
        return EXIT_CONFIG


if __name__ == "__main__":
    sys.exit(main())
