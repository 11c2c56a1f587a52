"""Dialogue with the operator at a terminal or pipe."""

import sys
import termios
from contextlib import suppress

from common.errors import RobotError
from common.text import printable


def show(text: str) -> None:
    """Print lines without buffering."""
    print(printable(text, "\n"), flush=True)


def prompt(question: str) -> str:
    """Return one stripped line; input typed before the question is discarded.

    Raise ``RobotError`` at the end of the input.
    """
    if sys.stdin.isatty():
        with suppress(termios.error):
            termios.tcflush(sys.stdin, termios.TCIFLUSH)
    print(question, end=" ", flush=True)
    line = sys.stdin.readline()
    if not line:
        raise RobotError("standard input has ended before all questions were answered")
    return line.strip()


def confirm(fact: str, phrase: str) -> bool:
    """Return whether the operator types the phrase."""
    return prompt(f'{fact}\nType "{phrase}" to confirm:').lower() == phrase
