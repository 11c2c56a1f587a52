"""Dialogue of ``t2 checkout``; on a real stack: ``tests/cli/test_on_stack.py``."""

from pathlib import Path
from typing import Any

import pytest

from cli.__main__ import main
from cli.commission import command, steps
from cli.commission.report import Verdict, failed
from cli.commission.steps import PHRASE, RESET_PHRASE, Step, confirm
from common.cli_args import EXIT_CONFIG
from common.errors import ConfigError
from t2.errors import LinkError

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


def test_an_unwritable_report_is_found_before_the_checkout(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(command, "checkout", lambda *_: pytest.fail("it has begun"))
    there = tmp_path / "there.md"
    there.write_text("kept")
    for file, error in ((Path("/proc/x.md"), "cannot be written: "), (there, "exists already")):
        assert main(["checkout", "drive", "--report", str(file)]) == EXIT_CONFIG
        assert f"--report {file}: {error}" in capsys.readouterr().err
    assert there.read_text() == "kept"


def test_a_checkout_that_does_not_begin_leaves_no_report(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def checkout(*_: object) -> None:
        assert (tmp_path / "new.md").exists()
        raise LinkError("no stack")

    monkeypatch.setattr(command, "checkout", checkout)
    assert main(["checkout", "drive", "--report", str(tmp_path / "new.md")]) != 0
    assert list(tmp_path.iterdir()) == []


def test_a_report_that_cannot_be_written_is_printed(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match="cannot be written"):
        command.write(tmp_path, "# Checkout")
    assert "# Checkout" in capsys.readouterr().out
