"""Entry point of teleop: ``python -m services.teleop`` and ``t2 drive``.

The node's loop runs in a thread of its own, the screen in the main thread. Every shutdown is the
same: the controller sends its final zeros, its loop ends, then the screen exits. The screen's end,
a signal or a lost terminal starts it. The loop polls the terminal, because a screen that writes to
a dead terminal may hang; the process then ends without restoring the terminal.
"""

import argparse
import os
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from types import FrameType

from common import log
from common.cli_args import (
    add_setting,
    add_sources,
    needs_extra,
    reader_language,
    run_program,
    source_words,
    sources,
)
from common.config import Loaded, load
from common.service import Node
from services.teleop.config import TeleopConfig
from services.teleop.controller import Controller
from services.teleop.event_log import EventLog
from services.teleop.gamepad import find
from services.teleop.labels import Labels
from t2.errors import T2Error

EXIT_HANGUP = 128 + signal.SIGHUP
TERMINAL_POLL_S = 0.2
END_TIMEOUT_S = 5.0  # for the final zeros, and an emergency stop that is repeated for 3 s


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command line options; each sets a setting."""
    text = "name of the drive source, which has its own priority"
    add_setting(parser, "--source", "teleop.source", text)
    add_setting(parser, "--robot", "robot.id", "robot to drive, such as 001")
    parser.add_argument(
        "--no-gamepad", action="append_const", dest="sets", const="teleop.gamepad=false",
        help="use the keyboard only",
    )  # fmt: skip
    add_sources(parser)


def run(options: argparse.Namespace) -> int:
    """Drive until the operator quits; raise ``T2Error`` if teleop cannot start."""
    loaded = load(TeleopConfig, sources(options))
    if not terminal_is_there():
        raise T2Error("driving needs a terminal on standard input and output")
    labels = Labels(reader_language())
    return TeleopProcess(loaded, labels, source_words(options)).run()


class TeleopProcess:
    """Teleop's process: the node's loop, the controller and the screen."""

    def __init__(self, loaded: Loaded[TeleopConfig], labels: Labels, words: Sequence[str]) -> None:
        with needs_extra("teleop", "the screen"):
            from services.teleop.app import TeleopApp
        self._screen, self._labels = TeleopApp, labels
        event_log = EventLog()
        event_log.capture_logs(loaded.config.log)
        self._settings = loaded.config
        self._node = node = Node("teleop", loaded)
        self._controller = controller = Controller(node, event_log, words)
        node.announce()
        node.loop.every(TERMINAL_POLL_S, self._check_terminal)
        node.loop.post(lambda: controller.use_gamepad(find(self._settings.teleop)))
        self._lost = False
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._serve, name="controller")

    def run(self) -> int:
        """Run the screen in the main thread and return the exit code."""
        post = self._node.loop.post
        _on_signal(self._leave, signal.SIGINT, signal.SIGTERM)
        _on_signal(self._hang_up, signal.SIGHUP)
        self._node.open()
        self._thread.start()
        try:
            self._screen(
                self._controller, post, lambda: not self._thread.is_alive(),
                self._settings.teleop, self._labels,
            ).run()  # fmt: skip
        finally:
            self._leave()
            self._thread.join(END_TIMEOUT_S)
            log.configure(self._settings.log, "teleop")
        if self._error:
            raise self._error
        if phrases := self._controller.unconfirmed:
            raise T2Error(self._labels.render(phrases))
        return 0

    def _serve(self) -> None:
        try:
            self._node.loop.run()
        except BaseException as error:  # raised again in the main thread, once the screen is down
            self._error = error
        self._node.close()
        if self._lost:
            os._exit(EXIT_HANGUP)

    def _leave(self) -> None:
        self._node.loop.post(self._controller.leave)

    def _hang_up(self) -> None:
        self._lost = True
        self._leave()

    def _check_terminal(self, _: int) -> None:
        if not terminal_is_there():
            self._hang_up()


def terminal_is_there() -> bool:
    """Return whether standard input and output are still a terminal."""
    return os.isatty(0) and os.isatty(1)


def main(argv: Sequence[str] | None = None) -> int:
    """Drive from this terminal; return the exit code, as for every service."""
    return run_program("teleop", add_arguments, run, argv)


def _on_signal(call: Callable[[], None], *numbers: signal.Signals) -> None:
    def handle(number: int, _: FrameType | None) -> None:
        signal.signal(number, signal.SIG_DFL)  # a second one ends the process at once
        call()

    for number in numbers:
        signal.signal(number, handle)


if __name__ == "__main__":
    sys.exit(main())
