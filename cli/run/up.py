"""``t2 up``: router, simulated vehicle, bridge, safety, odometry and recorder, until Ctrl-C.

``--ros2`` adds the gateway to ROS 2, which lets ROS nodes drive.
"""

import argparse
import os
import shlex
import signal
import socket
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib.util import find_spec

from cli.run.ports import claimed, wanted
from cli.run.router import add_insecure
from cli.run.supervisor import Supervisor
from cli.settings import Everything
from common import log, realtime
from common.child_process import command
from common.cli_args import add_setting, add_sources, needs_extra, source_words, sources
from common.config import load
from common.errors import ConfigError
from sim.config import add_profiles, load_model
from sim.sockets import HOST

Commands = dict[str, Sequence[str]]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument("--no-sim", action="store_true", help="use a real board")
    parser.add_argument("--only", metavar="NAME", help="start only this process, such as bridge")
    add_setting(parser, "--world", "sim.world", "world of the simulated vehicle")
    add_profiles(parser)
    parser.add_argument(
        "--no-router", action="store_true", help="use a running router, such as zenohd"
    )
    parser.add_argument(
        "--ros2", action="store_true", help="start the gateway to ROS 2, too: it takes cmd_vel"
    )
    parser.add_argument(
        "--until-eof", action="store_true",
        help="end with standard input: a pipe ends when the process that started this one dies",
    )  # fmt: skip
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
    if config.host.realtime:
        realtime.request(realtime.SUPERVISOR, alone=True)
    log.configure(config.log, "up")
    made = everything(options)
    started = selected(made | camera(options, config, made), options.only)
    with claimed(wanted(config, started)):
        supervisor = Supervisor(started)
        for name in (signal.SIGINT, signal.SIGTERM):
            signal.signal(name, lambda *_: supervisor.stop())
        if options.until_eof:
            threading.Thread(target=await_eof, args=[supervisor.stop], daemon=True).start()
        drive = shlex.join(["t2", "drive", *source_words(options)])
        log.Logger().info(
            f"starting; `{drive}` in a second terminal drives it",
            robot=config.robot.id,
            board=f"{config.board.address}:{config.board.port}",
            simulated=not options.no_sim,
            bus=list(config.bus.endpoints),
        )
        return supervisor.run()


def await_eof(then: Callable[[], None]) -> None:
    """Call a function at the end of standard input."""
    with suppress(OSError):
        while os.read(0, 4096):
            pass
    then()


def everything(options: argparse.Namespace) -> Commands:
    """Return the commands for these options; the recorder if its library is installed."""
    passed = source_words(options)
    made = commands(passed, options.profile)
    if options.no_router:
        del made["router"]
    if options.no_sim:
        del made["sim"]
    made["localization"] = command("services.localization", *passed)
    made["patrol"] = command("services.patrol", *passed)
    if find_spec("mcap"):
        made["recorder"] = command("services.recorder", *passed)
    if options.ros2:
        with needs_extra("ros2", "--ros2"):
            import xxhash  # noqa: F401
        made["ros2"] = command("services.ros2", *passed)
    return made


def camera(options: argparse.Namespace, config: Everything, made: Commands) -> Commands:
    """Return the camera of the settings, or else a simulated one; none without its library."""
    is_simulated = "sim" in made and not config.camera.source
    if not find_spec("av") or not (config.camera.source or is_simulated):
        return {}
    if not is_simulated:
        return {"camera": command("services.camera", *source_words(options))}
    control = config.sim.control_port or free_port(socket.SOCK_DGRAM)
    port = config.sim.camera_port or free_port(socket.SOCK_STREAM)
    of_sim = argparse.Namespace(
        config=(), sets=[f"sim.control_port={control}", f"sim.camera_port={port}"]
    )
    of_camera = argparse.Namespace(
        config=(), sets=[f"camera.source=tcp://{HOST}:{port}", "camera.latency=0"]
    )
    passed, ports = source_words(options), source_words(of_sim)
    return {
        "sim": [*made["sim"], *ports],
        "sim.camera": command("sim.camera", *passed, *ports),
        "camera": command("services.camera", *passed, *source_words(of_camera)),
    }


def free_port(kind: socket.SocketKind) -> int:
    """Return a port of this host that nothing uses at this moment."""
    with socket.socket(socket.AF_INET, kind) as sock:
        sock.bind((HOST, 0))
        return int(sock.getsockname()[1])


def commands(passed: Sequence[str], profiles: Sequence[str] = ()) -> Commands:
    """Return the commands of a simulated robot by name: later processes depend on earlier ones."""
    unkind = [word for name in profiles for word in ("--profile", name)]
    modules = {"router": ["cli", "router"], "sim": ["sim", *unkind]}
    modules |= {name: [f"services.{name}"] for name in ("bridge", "safety", "odom")}
    return {name: command(*words, *passed) for name, words in modules.items()}


def selected(available: Commands, only: str | None) -> Commands:
    """Return the selected process, or all; raise ``ConfigError`` for an unknown name."""
    if only is None:
        return available
    if only not in available:
        raise ConfigError(f"--only {only}: no such process; available: {', '.join(available)}")
    return {only: available[only]}
