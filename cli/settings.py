"""The settings of the whole stack, and ``t2 config``, which shows them with their sources."""

import argparse
import json

from cli.inspect import output
from common import settings
from common.cli_args import add_sources, sources
from common.config import load
from services.bridge.config import Bridge
from services.dashboard.config import Dashboard
from services.metrics.config import Metrics
from services.odom.config import Odom
from services.recorder.config import Recorder
from services.ros2.config import Ros2
from services.safety.config import Safety
from services.teleop.config import Teleop
from sim.config import Sim


class Everything(settings.Shared, frozen=True, kw_only=True):
    """All sections that a file in ``config/`` may have."""

    board: settings.Board = settings.Board()
    wire: settings.Wire = settings.Wire()
    vehicle: settings.Vehicle = settings.Vehicle()
    bridge: Bridge = Bridge()
    safety: Safety = Safety()
    odom: Odom = Odom()
    teleop: Teleop = Teleop()
    dashboard: Dashboard = Dashboard()
    recorder: Recorder = Recorder()
    metrics: Metrics = Metrics()
    ros2: Ros2 = Ros2()
    sim: Sim = Sim()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Print every setting with its value and source."""
    first, *others = (
        (path, json.dumps(setting.value, ensure_ascii=False), setting.origin)
        for path, setting in load(Everything, sources(options)).settings.items()
    )
    print(output.table(first, others))
    return 0
