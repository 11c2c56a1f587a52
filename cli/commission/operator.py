"""The operator at a plain terminal, or a script at the other end of a pipe."""

import sys
import termios
import time
from contextlib import suppress

from common.errors import RobotError


class NobodyThereError(RobotError):
    """Standard input has ended: there is nobody to answer."""


class Operator:
    """Is told things and asked things; what was typed before a question does not answer it."""

    def say(self, text: str) -> None:
        """Print a line at once, also into a pipe."""
        print(text, flush=True)

    def ask(self, question: str) -> str:
        """Return one line, without the blanks around it; raise ``NobodyThereError`` at the end."""
        if sys.stdin.isatty():
            with suppress(termios.error):
                termios.tcflush(sys.stdin, termios.TCIFLUSH)
        print(question, end=" ", flush=True)
        line = sys.stdin.readline()
        if not line:
            raise NobodyThereError("standard input has ended before all questions were answered")
        return line.strip()

    def confirm(self, fact: str, phrase: str) -> bool:
        """Have the operator type a phrase; anything else is a no."""
        return self.ask(f'{fact}\nType "{phrase}" when it is so:').lower() == phrase

    def now(self) -> str:
        """Return the local date and time."""
        return time.strftime("%Y-%m-%d %H:%M:%S %z")
