"""Dialogue with the operator: questions, the walk through the steps, and the signature."""

import sys
import termios
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

from cli.commission.report import Checked, Verdict
from common.errors import RobotError


class InputEndedError(RobotError):
    """Standard input has ended before all questions were answered."""


class Operator:
    """Operator at a terminal or pipe; input typed before a question is discarded."""

    def show(self, text: str) -> None:
        """Print a line without buffering."""
        print(text, flush=True)

    def prompt(self, question: str) -> str:
        """Return one stripped line; raise ``InputEndedError`` at the end of input."""
        if sys.stdin.isatty():
            with suppress(termios.error):
                termios.tcflush(sys.stdin, termios.TCIFLUSH)
        print(question, end=" ", flush=True)
        line = sys.stdin.readline()
        if not line:
            raise InputEndedError("standard input has ended before all questions were answered")
        return line.strip()

    def confirm(self, fact: str, phrase: str) -> bool:
        """Return whether the operator types the phrase."""
        return self.prompt(f'{fact}\nType "{phrase}" to confirm:').lower() == phrase

    def now(self) -> str:
        """Return the local date and time."""
        return time.strftime("%Y-%m-%d %H:%M:%S %z")


@dataclass(frozen=True, slots=True)
class Check:
    """One step of a checkout; ``what`` is the instruction to the operator."""

    name: str
    title: str
    what: str
    run: Callable[[], Verdict]


def walk(checks: Sequence[Check], operator: Operator, checked: list[Checked]) -> None:
    """Run the checks with the operator; results are appended to ``checked``, even on an abort."""
    for number, check in enumerate(checks, 1):
        operator.show(f"\n[{number}/{len(checks)}] {check.title}\n{check.what}")
        checked.append(Checked(check.name, check.title, _run(check, operator)))


def sign(operator: Operator, name: str, checked: Sequence[Checked]) -> str:
    """Show the results and ask for the signature; return the name, or an empty string."""
    operator.show("")
    for each in checked:
        operator.show(f"{each.verdict.outcome:8} {each.title}: {each.verdict.text}")
    typed = operator.prompt(f"To sign this off, type your name ({name}):")
    return name if name and typed.casefold() == name.casefold() else ""


def _run(check: Check, operator: Operator) -> Verdict:
    reason = operator.prompt("Press Enter to begin, or type a reason to skip:")
    if reason:
        return Verdict("skipped", reason)
    while True:
        verdict = check.run()
        operator.show(f"{verdict.outcome}: {verdict.text}")
        if verdict.outcome == "passed" or operator.prompt(
            "Press Enter to try again, or type any word to continue:"
        ):
            return verdict
