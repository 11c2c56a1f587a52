"""Dialogue of ``t2 checkout``; on a real stack: ``tests/cli/test_on_stack.py``."""

from typing import Any

import pytest

from cli.__main__ import main
from cli.commission import command, steps
from cli.commission.report import Verdict, failed
from cli.commission.steps import PHRASE, RESET_PHRASE, Step, confirm
from common.cli_args import EXIT_CONFIG

SESSION: Any = None
NOT_CONFIRMED = failed("Not confirmed: no motion was requested.")
DRIVEN = Verdict("passed", "The wheels turned.")


def drive(_: object) -> Verdict:
    return DRIVEN if confirm("The wheels will turn.", PHRASE) else NOT_CONFIRMED


@pytest.mark.parametrize(
    ("typed", "found"),
    [
        (["no room"], Verdict("skipped", "no room")),
        ([PHRASE.upper(), PHRASE], DRIVEN),  # too early: it begins, and is asked for
        ([RESET_PHRASE, PHRASE], DRIVEN),
        (["", "wheel", "", PHRASE], DRIVEN),
        (["", "", PHRASE, PHRASE], DRIVEN),  # too late: it tries again
        (["", "", "next"], NOT_CONFIRMED),
    ],
)
def test_the_phrase_neither_skips_nor_continues(
    typed: list[str], found: Verdict, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = iter(typed)
    for module in (command, steps):
        monkeypatch.setattr(module, "prompt", lambda _: next(answers))
    assert command.verdict(Step("forward", "Forward", "", drive), SESSION) == found
    assert list(answers) == []


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (["--only", "straight"], "--only straight: allowed are link, sonar, bumper, estop, forwa"),
        (["--space", "2"], "--space: is an option of `t2 checkout drive`"),
        (["drive", "--only", "link"], "--only link: allowed are standstill, straight, spot, curve"),
    ],
)
def test_options_of_another_part_are_refused(
    words: list[str], error: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["checkout", *words]) == EXIT_CONFIG
    assert error in capsys.readouterr().err
