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


def test_the_whole_report() -> None:
    assert (
        render(REPORT)
        == """\
# Checkout of robot 001

**Passed.**

| what | value |
| --- | --- |
| date | 2026-03-01 10:00:00 +0800 |
| operator | Ada |
| board | 10.7.5.224:4002 |

## Steps

| step | result | finding |
| --- | --- | --- |
| Link | passed | The board's link is up. |

### Link

| measured | value |
| --- | --- |
| state | up |

## Effective settings

| setting | value | from |
| --- | --- | --- |
| wire.crc | crc-16 | config/t2.toml |

## Signed off

Ada, 2026-03-01 10:20:00 +0800
"""
    )


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
