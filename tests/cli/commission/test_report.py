"""The report: conditions of a pass, and escaping of the operator's input."""

from dataclasses import replace

import pytest

from cli.commission.report import Report, Verdict, render

GOOD = ("Link", Verdict("passed", "The board's link is up.", (("state", "up"),)))
SKIPPED = ("Turn", Verdict("skipped", "no blocks | today\nsorry"))
REPORT = Report(
    robot="001",
    date="2026-03-01 10:00:00 +0800",
    facts=[("board", "10.7.5.224:4002")],
    settings=[("wire.crc", "crc-16", "config/t2.toml")],
    operator="Ada",
    steps=[GOOD],
    signed="Ada",
    ended="2026-03-01 10:20:00 +0800",
)


def test_a_signed_report() -> None:
    lines = render(REPORT).splitlines()
    assert lines[2] == "**Passed.**"
    assert lines[-1] == "Ada, 2026-03-01 10:20:00 +0800"
    for row in (
        "| board | 10.7.5.224:4002 |",
        "| Link | passed | The board's link is up. |",
        "| state | up |",
        "| wire.crc | crc-16 | config/t2.toml |",
    ):
        assert row in lines


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"steps": [GOOD, SKIPPED]}, "| Turn | skipped | no blocks \\| today sorry |"),
        ({"steps": []}, "**Not passed.**"),
        ({"aborted": "ctrl-c"}, "**Not passed.** Ended early: ctrl-c."),
        ({"signed": ""}, "Not signed."),
    ],
)
def test_conditions_that_do_not_pass(change: dict[str, object], text: str) -> None:
    report = replace(REPORT, **change)  # type: ignore[arg-type]
    assert not report.passed
    shown = render(report)
    assert "**Not passed.**" in shown
    assert text in shown


def test_a_partial_checkout_may_pass() -> None:
    report = replace(REPORT, left_out=["bumper", "sonar"])
    assert report.passed
    assert "Partial checkout, left out: bumper, sonar." in render(report)
