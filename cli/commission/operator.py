"""Dialogue with the operator at a terminal or pipe: questions, steps, and the signature."""

import sys
import termios
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

from cli.commission.report import Verdict
from cli.commission.session import CheckoutSession
from common.errors import RobotError
from common.text import printable


@dataclass(frozen=True)
class Step:
    """One step of a checkout; ``what`` is the instruction to the operator."""

    name: str
    title: str
    what: str
    run: Callable[[CheckoutSession], Verdict]


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


def walk(
    steps: Sequence[Step], session: CheckoutSession, checked: list[tuple[str, Verdict]]
) -> None:
    """Run the steps with the operator; results are appended to ``checked``, even on an abort."""
    for number, step in enumerate(steps, 1):
        show(f"\n[{number}/{len(steps)}] {step.title}\n{step.what}")
        checked.append((step.title, _verdict(step, session)))


def sign(name: str, checked: Sequence[tuple[str, Verdict]]) -> str:
    """Show the results and ask for the signature; return the name, or an empty string."""
    show("")
    for title, verdict in checked:
        show(f"{verdict.outcome:8} {title}: {verdict.text}")
    typed = prompt(f"To sign this off, type your name ({name}):")
    return name if name and typed.casefold() == name.casefold() else ""


def _verdict(step: Step, session: CheckoutSession) -> Verdict:
    reason = prompt("Press Enter to begin, or type a reason to skip:")
    if reason:
        return Verdict("skipped", reason)
    while True:
        verdict = step.run(session)
        show(f"{verdict.outcome}: {verdict.text}")
        if verdict.outcome == "passed" or prompt(
            "Press Enter to try again, or type any word to continue:"
        ):
            return verdict
