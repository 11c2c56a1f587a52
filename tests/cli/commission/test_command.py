"""Dialogue of ``t2 checkout``; on a real stack: ``tests/cli/test_on_stack.py``."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from cli.__main__ import main
from cli.commission import command, steps
from cli.commission.report import Report, Verdict, failed, render
from cli.commission.steps import Step, confirm
from common.cli_args import EXIT_CONFIG
from common.errors import ConfigError
from common.freshness import Latest
from t2 import keys
from t2.errors import LinkError, T2Error
from tests.factories import health

PHRASE = "wheels off the ground"
SESSION: Any = SimpleNamespace(so_far=None)
NOT_CONFIRMED = failed("Not confirmed: no motion was requested.")
DRIVEN = Verdict("passed", "The wheels turned.")
AFTER = Verdict("passed", f"The wheels turned. Before that: {NOT_CONFIRMED.text}")


def drive(_: object) -> Verdict:
    return DRIVEN if confirm("The wheels will turn.", "off_ground") else NOT_CONFIRMED


@pytest.mark.parametrize(
    ("typed", "found"),
    [
        (["no room"], Verdict("skipped", "no room")),
        ([PHRASE.upper(), PHRASE], DRIVEN),  # too early: it begins, and is asked for
        (["reset", PHRASE], DRIVEN),
        (["复位", "车轮离地"], DRIVEN),
        (["", "车轮离地"], DRIVEN),
        (["", "wheel", "", PHRASE], AFTER),
        (["", "", PHRASE, PHRASE], AFTER),  # too late: it tries again
        (["", "", "no key"], failed(f"{NOT_CONFIRMED.text} Remark: no key")),
    ],
)
def test_the_phrase_neither_skips_nor_continues(
    typed: list[str], found: Verdict, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = iter(typed)
    for module in (command, steps):
        monkeypatch.setattr(module, "prompt", lambda _: next(answers))
    noted: list[Verdict] = []
    step = Step("forward", ("Forward", "前进"), ("", ""), drive)
    assert command.verdict(step, SESSION, noted.append) == found
    is_begun = found.outcome != "skipped"
    assert bool(noted) == is_begun
    assert list(answers) == []


@pytest.mark.parametrize(
    ("typed", "signed"),
    [(["ada"], "Ada"), (["Adam", "Ada"], "Ada"), ([""], ""), (["Adam", "Bob", ""], "")],
)
def test_a_wrong_signature_is_asked_again(
    typed: list[str], signed: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers, asked = iter(typed), []

    def prompt(question: str) -> str:
        asked.append(question)
        return next(answers)

    monkeypatch.setattr(command, "prompt", prompt)
    assert command.signature("Ada") == signed
    assert list(answers) == []
    assert all("is not Ada" in question for question in asked[1:])


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (["--only", "straight"], "--only straight: allowed are link, sonar, bumper, estop, forwa"),
        (["--space", "2"], "--space: is an option of `t2 checkout drive`"),
        (["drive", "--resume", "a.md"], "--resume: is no option of `t2 checkout drive`"),
        (["drive", "--only", "link"], "--only link: allowed are standstill, straight, spot, curve"),
    ],
)
def test_options_of_another_part_are_refused(
    words: list[str], error: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["checkout", *words]) == EXIT_CONFIG
    assert error in capsys.readouterr().err


def report(steps: list[tuple[str, Verdict]], unit: str = "rad", robot: str = "001") -> Report:
    settings = [("wire.unit", unit, "default")]
    facts = [("board", "here")]
    return Report(robot=robot, date="today", facts=facts, settings=settings, steps=steps)


LINK, SONARS = ("Link", Verdict("passed", "up")), ("Sonars", Verdict("passed", "in place"))
DONE = "[today, Ada]"


@pytest.mark.parametrize(
    ("unit", "board", "taken", "changed"),
    [
        ("rad", "here", [f"up {DONE}", f"in place {DONE}"], ""),
        ("degree", "here", [f"in place {DONE}"], "wire.unit"),
        ("rad", "there", [], "board is now there"),
    ],
)
def test_a_resumed_checkout_repeats_what_has_not_passed_or_may_have_changed(
    unit: str, board: str, taken: list[str], changed: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = report([LINK, SONARS, ("Bumper", failed("stuck"))])
    before.operator = "Ada"
    now, again = report([], unit), Verdict("passed", "again")
    now.facts = [("board", board)]
    monkeypatch.setattr(command, "verdict", lambda *_: again)
    command.run_steps(now, SESSION, [], before)
    assert [found.finding for _, found in now.steps if found is not again] == taken
    assert len(now.steps) == len(steps.STEPS)
    assert [value for name, value in now.facts if name.startswith("changed")] == [changed] * bool(
        changed
    )
    third = report([], unit)
    third.facts = now.facts
    command.run_steps(third, SESSION, ["link"], now)
    assert len(third.steps) == 1  # only what is selected, with its first origin
    assert third.steps[0][1].finding.count("[") == 1


@pytest.mark.parametrize(
    ("answers", "findings"),
    [
        ([], []),  # Ctrl-C at the first question: the step has not begun
        ([""], ["Not completed."]),  # Ctrl-C in the step
        (["", "again"], ["no echo"]),  # Ctrl-C at the question after it failed
    ],
)
def test_an_interrupted_step_stays_in_the_report(
    answers: list[str], findings: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    left = iter(answers)

    def prompt(_: str) -> str:
        if (typed := next(left, None)) in (None, "again"):
            raise KeyboardInterrupt
        return str(typed)

    def run(_: object) -> Verdict:
        if len(answers) == 1:
            raise KeyboardInterrupt
        return failed("no echo")

    for module in (command, steps):
        monkeypatch.setattr(module, "prompt", prompt)
    monkeypatch.setattr(command, "STEPS", (Step("link", ("Link", "链路"), ("", ""), run),))
    it = report([])
    with pytest.raises(KeyboardInterrupt):
        command.run_steps(it, SESSION, [])
    assert [found.finding for _, found in it.steps] == findings
    assert it.missing == ["Link"]


@pytest.mark.parametrize("end", [KeyboardInterrupt(), T2Error("standard input has ended")])
def test_what_an_interrupted_step_has_found_is_in_the_report(
    end: BaseException, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(session: Any) -> Verdict:
        session.so_far = failed("left: the hand was detected by right.")
        raise end

    monkeypatch.setattr(steps, "prompt", lambda _: "")
    noted: list[Verdict] = []
    step, session = Step("sonar", ("Sonars", ""), ("", ""), run), cast(Any, SimpleNamespace())
    with pytest.raises(type(end)):
        command.verdict(step, session, noted.append)
    assert noted[-1].text == "left: the hand was detected by right."


def test_only_the_services_of_every_robot_count_as_its_version() -> None:
    """Others are in the report or not by chance: a resumed checkout would begin anew."""
    found = [Latest(health(name), 0) for name in (*keys.ON_BOARD, "camera")]
    session: Any = SimpleNamespace(of=lambda _: found, until=lambda *_: True)
    assert [name for name, _ in command.versions(session)] == [
        "T2 of bridge", "T2 of odom", "T2 of safety"
    ]  # fmt: skip


def test_steps_that_were_not_reached_are_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    it, outcomes = report([]), iter([LINK[1], failed("no hand")])
    monkeypatch.setattr(command, "verdict", lambda *_: next(outcomes))
    with pytest.raises(StopIteration):
        command.run_steps(it, SESSION, [])
    assert it.missing == [step.title[0] for step in steps.STEPS[1:]]


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("# A page", "is no whole report of the steps, of this version of T2"),
        (render(report([])), "is no whole report of the steps, of this version of T2"),
        (render(report([LINK], robot="7")), "is of robot 7, not of 001"),
        (render(replace(report([LINK]), language="zh")), "has another language; use T2_LANG=zh"),
        (None, "cannot be read: No such file"),
    ],
)
def test_what_cannot_be_resumed(
    text: str | None, error: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "old.md"
    if text is not None:
        file.write_text(text)
    assert main(["checkout", "--resume", str(file)]) == EXIT_CONFIG
    assert f"--resume {file}: {error}" in capsys.readouterr().err


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
