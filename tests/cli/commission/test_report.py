"""The report: what passes, and what an operator's odd words do to its tables."""

from dataclasses import replace

import pytest

from cli.commission.report import Checked, Report, render
from cli.commission.verdict import Verdict, judged

GOOD = Checked("link", "Link", Verdict("passed", "The board is heard.", (("state", "up"),)))
SKIPPED = Checked("turn", "Turn", Verdict("skipped", "no blocks | today\nsorry"))
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
| Link | passed | The board is heard. |

### Link

| measured | value |
| --- | --- |
| state | up |

## Settings in force

| setting | value | from |
| --- | --- | --- |
| wire.crc | crc-16 | config/t2.toml |

## Signed off

Ada, 2026-03-01 10:20:00 +0800
"""
    )


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"steps": [GOOD, SKIPPED]}, "| Turn | skipped | no blocks \\| today sorry |"),
        ({"steps": []}, "**Not passed.**"),
        ({"aborted": "ctrl-c"}, "**Not passed.** Ended early: ctrl-c."),
        ({"signed": ""}, "Nobody has signed."),
    ],
)
def test_what_does_not_pass(change: dict[str, object], said: str) -> None:
    report = replace(REPORT, **change)  # type: ignore[arg-type]
    assert not report.passed
    text = render(report)
    assert "**Not passed.**" in text
    assert said in text


def test_a_part_may_pass_and_says_that_it_is_one() -> None:
    report = replace(REPORT, left_out=["crc", "sonar"])
    assert report.passed
    assert "Only a part: crc, sonar were not asked for." in render(report)


def test_a_verdict_is_failed_by_any_problem() -> None:
    assert judged(["", "A.", "B."], "fine") == Verdict("failed", "A. B.")
    assert judged(["", ""], "fine") == Verdict("passed", "fine")
