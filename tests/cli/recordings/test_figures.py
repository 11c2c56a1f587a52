"""Figures of a report: gaps, ids, and drawings of almost nothing."""

import math
import re
from xml.etree import ElementTree as ET

import msgspec

from cli.recordings import figures
from cli.recordings.timeline import Timeline
from common.messages import Drive, Limits, SafetyState
from tests.cli.recordings import drive_fixture
from tests.cli.recordings.drive_fixture import drive


def timeline_of_the_drive() -> Timeline:
    timeline = Timeline()
    for arrival in drive():
        timeline.add(*arrival)
    return timeline


def lines_of(svg: str, color: str) -> list[str]:
    """Return the points of each line of this colour, without those of the legend."""
    paths = ET.fromstring(svg).iter("{http://www.w3.org/2000/svg}path")
    return [path.attrib["d"] for path in paths if path.get("stroke") == color]


def test_a_gap_breaks_the_line() -> None:
    timeline = timeline_of_the_drive()
    whole = lines_of(figures.speeds(timeline), figures.MEASURED)
    timeline.linear.measured.values[50] = math.nan
    broken = lines_of(figures.speeds(timeline), figures.MEASURED)
    assert len(broken) == len(whole) + 1
    assert not any("nan" in points for points in broken)


def test_a_single_point_makes_no_path() -> None:
    timeline = Timeline()
    timeline.add(*drive_fixture.at("tel/odom/odometry", drive_fixture.odometry(1), 0.0))
    timeline.add(*drive_fixture.at("tel/safety/state", drive_fixture.state(False), 0.0))
    drawn = figures.path(timeline) + figures.speeds(timeline)
    assert re.findall(r' d="M[^"L]*"', drawn)
    assert re.findall(r' d="[^"]*L *"', drawn) == []


def test_non_finite_values_are_left_out() -> None:
    timeline, value = Timeline(), math.inf
    pose = drive_fixture.odometry(1)
    for number, message in enumerate(
        (
            msgspec.structs.replace(pose, x=value),
            Drive(seq=1, boot=1, linear=value, angular=value, echo=1),
            SafetyState(
                verdict="run", latched=(), causes=(), source=None, heartbeat=1, text="",
                limits=Limits(forward=value, backward=value, angular=value),
            ),
        )
    ):  # fmt: skip
        timeline.add(*drive_fixture.at("@cmd/drive/teleop", message, number / 10))
    assert timeline.path == []
    assert "requested by teleop" in figures.speeds(timeline)
    timeline.add(*drive_fixture.at("tel/odom/odometry", pose, 1.0))
    assert "start" in figures.path(timeline)
