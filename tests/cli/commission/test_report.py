"""The report: conditions of a pass, and escaping of the operator's input."""

from dataclasses import replace

import pytest

from cli.commission.report import Report, Verdict, parse, render

GOOD = ("Link", Verdict("passed", "The board's link is up."))
SKIPPED = ("Turn", Verdict("skipped", "no blocks | today\nsorry"))
REPORT = Report(
    robot="001",
    date="2026-03-01 10:00:00 +0800",
    facts=[],
    settings=[],
    operator="Ada",
    steps=[GOOD],
    signed="Ada",
    ended="2026-03-01 10:20:00 +0800",
)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (
            {"left_out": ["bumper", "sonar"]},
            "**Passed.** Partial checkout, left out: bumper, sonar.",
        ),
        ({"steps": [GOOD, SKIPPED]}, "| Turn | skipped | no blocks \\| today sorry |"),
        ({"steps": []}, "**Not passed.**"),
        ({"aborted": "ctrl-c"}, "**Not passed.** Ended early: ctrl-c."),
        ({"signed": ""}, "Not signed."),
        ({"steps": [], "manoeuvres": [GOOD]}, "**Passed.**"),
        ({"steps": [], "manoeuvres": [GOOD, SKIPPED]}, "**Not passed.**"),
    ],
)
def test_conditions_of_a_pass(change: dict[str, object], text: str) -> None:
    report = replace(REPORT, **change)  # type: ignore[arg-type]
    passed = "**Passed.**" in text
    assert report.passed is passed
    shown = render(report)
    assert ("**Not passed.**" in shown) is not passed
    assert text in shown


def test_a_manoeuvre_is_a_row_with_its_figures() -> None:
    data = (("commanded", "+0.200 m/s"), ("stop distance", "0.024 m"))
    stop = ("STOP forward", Verdict("passed", "As expected.", data))
    shown = render(replace(REPORT, steps=[], manoeuvres=[stop, SKIPPED]))
    assert "## Steps" not in shown
    assert "| STOP forward | +0.200 m/s |  |  |  |  |  | 0.024 m |  |  | passed | As ex" in shown
    assert "| Turn |  |  |  |  |  |  |  |  |  | skipped | no blocks" in shown


def test_a_report_contains_itself_whatever_the_operator_types() -> None:
    typed = ("Sonars", Verdict("failed", "--> <!-- t2 checkout {} -->\n| x |", (("a", "b"),)))
    settings = [("wire.unit", "rad", "default")]
    report = replace(REPORT, steps=[GOOD, typed], settings=settings, left_out=[])
    shown = render(report)
    assert parse(shown) == report
    assert "Still missing: Sonars." in shown
    assert parse(shown.replace('"robot"', '"vehicle"')) is None
    assert parse("# A page\n") is None


def test_a_report_in_chinese() -> None:
    shown = render(replace(REPORT, steps=[GOOD, SKIPPED], language="zh"))
    assert shown.startswith("# 机器人 001 验收报告\n\n**不合格。**尚未合格：Turn。\n")
    assert "| Turn | 已跳过 | no blocks" in shown
