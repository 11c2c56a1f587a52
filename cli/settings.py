"""The settings of the whole stack, and ``t2 config``, which shows them with their sources."""

import argparse
import json

from cli.inspect import output
from common import settings
from common.cli_args import add_sources, sources
from common.config import flatten, load
from common.errors import ConfigError
from services.camera.config import Camera
from services.dashboard.config import Dashboard
from services.localization.config import Localization
from services.metrics.config import Metrics
from services.odom.config import Odom
from services.patrol.config import Patrol
from services.recorder.config import Recorder
from services.ros2.config import Ros2
from services.safety.config import Safety, SafetyConfig
from services.teleop.config import Teleop
from sim.config import Sim


class Everything(settings.Shared, frozen=True, kw_only=True):
    """All sections that a file in ``config/`` may have."""

    board: settings.Board = settings.Board()
    wire: settings.Wire = settings.Wire()
    vehicle: settings.Vehicle = settings.Vehicle()
    safety: Safety = Safety()
    odom: Odom = Odom()
    localization: Localization = Localization()
    patrol: Patrol = Patrol()
    camera: Camera = Camera()
    teleop: Teleop = Teleop()
    dashboard: Dashboard = Dashboard()
    recorder: Recorder = Recorder()
    metrics: Metrics = Metrics()
    ros2: Ros2 = Ros2()
    sim: Sim = Sim()


def safety_config(config: Everything) -> SafetyConfig:
    """Return the sections of safety; raise ``ConfigError`` if they contradict each other."""
    try:
        return SafetyConfig(
            host=config.host, board=config.board, vehicle=config.vehicle, safety=config.safety
        )
    except ValueError as error:
        raise ConfigError(str(error)) from None


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "prefix", nargs="?", default="", metavar="PREFIX",
        help="only the settings whose path begins with it, such as safety.sources",
    )  # fmt: skip
    parser.add_argument(
        "--changed", action="store_true", help="only the values that differ from the defaults"
    )
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Print the chosen settings with their values and sources."""
    loaded = load(Everything, sources(options))
    defaults, values = dict(flatten(Everything())), dict(flatten(loaded.config))
    found = [path for path in values if path.startswith(options.prefix)]
    if not found:
        raise ConfigError(f"no setting begins with {options.prefix!r}")
    rows = [
        (path, json.dumps(setting.value, ensure_ascii=False), setting.origin)
        for path, setting in loaded.settings.items()
        if path in found and not (options.changed and values[path] == defaults.get(path))
    ]
    if rows:
        print(output.table(rows[0], rows[1:]))
    return 0
