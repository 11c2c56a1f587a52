"""Commands that run one service in this terminal: dashboard, drive, metrics, record, ros2, sim.

Each function returns the options and the entry point of its command. It imports the service only
then, so that ``t2`` starts fast.
"""

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from common.cli_args import add_sources

Main = Callable[[Sequence[str]], int]


@dataclass(frozen=True, slots=True)
class ServiceCommand:
    """A command, with the same functions as a command's module."""

    add_arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int]


def dashboard() -> ServiceCommand:
    """Return ``t2 dashboard``."""
    from services.dashboard import __main__ as service

    return ServiceCommand(service.add_arguments, service.run)


def drive() -> ServiceCommand:
    """Return ``t2 drive``."""
    from services.teleop import __main__ as service

    return ServiceCommand(service.add_arguments, service.drive)


def sim() -> ServiceCommand:
    """Return ``t2 sim``."""
    from sim import __main__ as simulator

    return ServiceCommand(simulator.add_arguments, simulator.run)


def metrics() -> ServiceCommand:
    """Return ``t2 metrics``."""
    from services.metrics import __main__ as service

    options = {
        "--host HOST": ("metrics.host", "address to listen on; only this machine by default"),
        "--port PORT": ("metrics.port", "port to listen on"),
        "--robots ROBOTS": (
            "metrics.robots", "robots to export: an id, a site as 'berlin-$*', or '*' for all",
        ),
    }  # fmt: skip
    return _with_settings(service.main, options)


def ros2() -> ServiceCommand:
    """Return ``t2 ros2``."""
    from services.ros2 import __main__ as service

    options = {
        "--domain ID": ("ros2.domain", "ROS_DOMAIN_ID; ros2.domain by default"),
        "--namespace NAME": ("ros2.namespace", "namespace of node and topics, such as /t2_001"),
    }
    return _with_settings(service.main, options)


def record() -> ServiceCommand:
    """Return ``t2 record``."""
    from services.recorder import __main__ as service

    options = {
        "--folder DIR": ("recorder.folder", "folder for the files; recorder.folder by default"),
        "--robot ROBOT": ("robot.id", "which robot, such as 001"),
    }
    defaults, fixed = ["recorder.make_room=false"], ["recorder.everything=true"]
    return _with_settings(service.main, options, defaults, fixed)


def _with_settings(
    main: Main,
    options: Mapping[str, tuple[str, str]],
    defaults: Sequence[str] = (),
    fixed: Sequence[str] = (),
) -> ServiceCommand:
    """Return a command whose options are settings; ``--set`` overrides ``defaults`` alone."""

    def add_arguments(parser: argparse.ArgumentParser) -> None:
        for option, (path, text) in options.items():
            name, metavar = option.split()
            parser.add_argument(name, dest=path, metavar=metavar, help=text)
        add_sources(parser)

    def run(given: argparse.Namespace) -> int:
        from cli.run.up import passed_on

        values = {path: vars(given)[path] for path, _ in options.values()}
        sets = [f"{path}={value}" for path, value in values.items() if value is not None]
        given.sets = [*defaults, *given.sets, *fixed, *sets]
        return main(passed_on(given))

    return ServiceCommand(add_arguments, run)
