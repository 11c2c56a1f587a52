"""Teleop's life: the node's loop in a thread of its own, the screen in the main one.

Every way out is the same: the desk sends its last zeros, its loop ends, and the screen, when there
is still one, leaves. The screen's end, whatever its reason, begins that; so does a signal; so does
a terminal that is gone, which the loop looks for by itself, because a screen that writes to a dead
terminal may hang. With no terminal to give back, the process then simply ends.
"""

import argparse
import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from common import log
from common.cli_args import EXIT_CONFIG, add_sources, sources
from common.config import Loaded, load
from common.errors import ConfigError, RobotError
from common.service import STOP_TIMEOUT_S, Node
from services.teleop.config import TeleopConfig
from services.teleop.controller import Desk
from services.teleop.event_log import Logbook
from services.teleop.gamepad import find
from services.teleop.round_trip import multiplexer

if TYPE_CHECKING:
    from services.teleop.app import TeleopApp

EXIT_HANGUP = 128 + signal.SIGHUP
LOOK_S = 0.2  # between two looks at the terminal


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options; all but the last two are settings."""
    parser.add_argument("--source", help="the name to drive under, with its own priority")
    parser.add_argument("--robot", help="which robot to drive, such as 001")
    parser.add_argument("--no-gamepad", action="store_true", help="keys only")
    add_sources(parser)


def drive(options: argparse.Namespace) -> int:
    """Drive until the operator leaves; raise ``RobotError`` when that cannot even begin."""
    if options.source:
        options.sets = [*options.sets, f"teleop.source={options.source}"]
    if options.robot:
        options.sets = [*options.sets, f"robot.id={options.robot}"]
    if options.no_gamepad:
        options.sets = [*options.sets, "teleop.gamepad=false"]
    loaded = load(TeleopConfig, sources(options))
    if not terminal_is_there():
        raise RobotError("driving needs a terminal on standard input and output")
    return Life(loaded).lead()


class Life:
    """One run of teleop."""

    def __init__(self, loaded: Loaded[TeleopConfig]) -> None:
        self._screen = _screen_class()
        logbook = Logbook()
        logbook.take_log(loaded.config.log)
        self._settings = loaded.config
        self._node = node = Node("teleop", loaded)
        self._desk = desk = Desk(node, logbook, multiplexer(os.environ, ancestors()))
        node.announce()
        node.loop.every(LOOK_S, self._look)
        node.loop.post(lambda: desk.plug(find(self._settings.teleop)))
        self._lost = False
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._serve, name="desk")

    def lead(self) -> int:
        """Run the screen in front of the loop, and return the exit code."""
        post = self._node.loop.post
        _on_signal(self._leave, signal.SIGINT, signal.SIGTERM)
        _on_signal(self._hang_up, signal.SIGHUP)
        self._node.bus.open()
        self._thread.start()
        try:
            self._screen(
                self._desk, post, lambda: not self._thread.is_alive(), self._settings.teleop
            ).run()
        finally:
            self._leave()
            self._thread.join(STOP_TIMEOUT_S)
            log.configure(self._settings.log, "teleop")
        if self._error:
            raise self._error
        return 0

    def _serve(self) -> None:
        try:
            self._node.loop.run()
        except BaseException as error:  # raised again in the main thread, once the screen is down
            self._error = error
        self._node.bus.close()
        self._node.loop.close()
        if self._lost:
            os._exit(EXIT_HANGUP)

    def _leave(self) -> None:
        self._node.loop.post(self._desk.leave)

    def _hang_up(self) -> None:
        self._lost = True
        self._leave()

    def _look(self, _: int) -> None:
        if not terminal_is_there():
            self._hang_up()


def terminal_is_there() -> bool:
    """Tell whether both ends of the terminal still answer."""
    return os.isatty(0) and os.isatty(1)


def ancestors() -> list[str]:
    """Return the names of the processes that this one descends from; empty without /proc."""
    names, pid = [], os.getppid()
    with contextlib.suppress(OSError, ValueError, IndexError):
        while pid:
            status = Path(f"/proc/{pid}/stat").read_text(errors="replace")
            name, _, rest = status.partition("(")[2].rpartition(")")
            names.append(name)
            pid = int(rest.split()[1])
    return names


def main(argv: Sequence[str] | None = None) -> int:
    """Drive from this terminal, with the exit codes of every service."""
    parser = argparse.ArgumentParser(prog="teleop")
    add_arguments(parser)
    try:
        return drive(parser.parse_args(argv))
    except RobotError as error:
        print(f"teleop: {error}", file=sys.stderr)  # noqa: T201 - there is no screen
        return EXIT_CONFIG if isinstance(error, ConfigError) else 1


def _screen_class() -> "type[TeleopApp]":
    try:
        from services.teleop.app import TeleopApp
    except ModuleNotFoundError as error:
        if error.name and error.name.split(".")[0] in {"textual", "rich"}:
            raise RobotError(
                f"the screen needs {error.name}: install the extra `teleop` "
                "(pip install -e '.[teleop]')"
            ) from None
        raise
    return TeleopApp


def _on_signal(call: Callable[[], None], *numbers: signal.Signals) -> None:
    def handle(number: int, _: FrameType | None) -> None:
        signal.signal(number, signal.SIG_DFL)  # a second one ends the process at once
        call()

    for number in numbers:
        signal.signal(number, handle)
