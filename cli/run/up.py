"""``t2 up``: router, simulated vehicle, bridge, safety, odometry and recorder, until Ctrl-C.

``--ros2`` adds the gateway to ROS 2.
"""

import argparse
import shlex
import signal
from collections.abc import Sequence
from importlib.util import find_spec

from cli.run.ports import claimed, wanted
from cli.run.router import add_insecure
from cli.run.supervisor import Supervisor
from cli.settings import Everything
from common import child_process, log, realtime
from common.cli_args import add_sources, sources
from common.config import load
from common.errors import ConfigError
from sim.config import add_profiles, load_model

Commands = list[tuple[str, Sequence[str]]]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("--no-sim", action="store_true", help="use a real board")
    parser.add_argument("--only", metavar="NAME", help="start only this process, such as bridge")
    parser.add_argument("--world", help="world of the simulated vehicle; sim.world by default")
    add_profiles(parser)
    parser.add_argument(
        "--no-router", action="store_true", help="use a running router, such as zenohd"
    )
    parser.add_argument(
        "--ros2", action="store_true", help="start the gateway to ROS 2, too: it takes cmd_vel"
    )
    add_insecure(parser)
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Keep the stack running until SIGINT or SIGTERM."""
    load_model(options.profile)  # refuses an invalid one before anything starts
    if options.no_sim and options.profile:
        raise ConfigError(
            "--profile changes the simulated vehicle: leave --no-sim or --profile out"
        )
    config = load(Everything, sources(options)).config
    if config.robot.realtime:
        realtime.request(realtime.SUPERVISOR, alone=True)
    log.configure(config.log, "up")
    started = selected([*commands(options), *recorder(options), *ros2(options)], options.only)
    with claimed(wanted(config, [name for name, _ in started])):
        return supervised(started, config, driving(options), simulated=not options.no_sim)


def driving(options: argparse.Namespace) -> str:
    """Return the command that drives this robot from another terminal, with its bus settings."""
    files = [word for file in options.config or () for word in ("--config", str(file))]
    sets = [word for text in options.sets if text.startswith("bus.") for word in ("--set", text)]
    return shlex.join(["t2", "drive", *files, *sets])


def supervised(started: Commands, config: Everything, hint: str, *, simulated: bool) -> int:
    """Supervise these processes until a signal; ``hint`` is the command that drives."""
    supervisor = Supervisor(started)
    for name in (signal.SIGINT, signal.SIGTERM):
        signal.signal(name, lambda *_: supervisor.stop())
    log.Logger().info(
        f"starting; `{hint}` in a second terminal drives it",
        robot=config.robot.id,
        board=f"{config.board.address}:{config.board.port}",
        simulated=simulated,
        bus=list(config.bus.endpoints),
    )
    return supervisor.run()


def selected(available: Commands, only: str | None) -> Commands:
    """Return the selected process, or all; raise ``ConfigError`` for an unknown name."""
    names = [name for name, _ in available]
    if only is not None and only not in names:
        raise ConfigError(f"--only {only}: no such process; available: {', '.join(names)}")
    return [each for each in available if only in (None, each[0])]


def commands(options: argparse.Namespace) -> Commands:
    """Return the commands by name: later processes depend on earlier ones."""
    passed = passed_on(options)
    # Demo and tests create their own options, and always need a router.
    modules = {} if vars(options).get("no_router") else {"router": ["cli", "router"]}
    if not options.no_sim:
        world = ["--world", options.world] if options.world else []
        unkind = [word for name in vars(options).get("profile", ()) for word in ("--profile", name)]
        modules["sim"] = ["sim", *world, *unkind]
    modules |= {name: [f"services.{name}"] for name in ("bridge", "safety", "odom")}
    return [(name, child_process.command(*words, *passed)) for name, words in modules.items()]


def recorder(options: argparse.Namespace) -> Commands:
    """Return the recorder's command, if its library is installed."""
    if find_spec("mcap") is None:
        return []
    return [("recorder", child_process.command("services.recorder", *passed_on(options)))]


def ros2(options: argparse.Namespace) -> Commands:
    """Return the command of the gateway to ROS 2, if wanted; raise ``ConfigError`` without xxhash.

    Only if wanted: it lets ROS nodes drive.
    """
    if not options.ros2:
        return []
    if find_spec("xxhash") is None:
        raise ConfigError(
            "--ros2 needs xxhash: install the extra `ros2` (pip install -e '.[ros2]')"
        )
    return [("ros2", child_process.command("services.ros2", *passed_on(options)))]


def passed_on(options: argparse.Namespace) -> list[str]:
    """Return the options that select the settings, as given."""
    files = [word for file in options.config or () for word in ("--config", str(file))]
    return files + [word for text in options.sets for word in ("--set", text)]
