"""Figures of a report: gaps, and drawings of almost nothing."""

import math
import re
from xml.etree import ElementTree as ET

import pytest

from cli.recordings import figures
from tests import factories
from tests.cli.recordings.drive_fixture import at, drive, in_the_map, state, timeline_of


def lines_of(svg: str, color: str) -> list[str]:
    """Return the points of each line of this colour, without those of the legend."""
    paths = ET.fromstring(svg).iter("{http://www.w3.org/2000/svg}path")
    return [path.attrib["d"] for path in paths if path.get("stroke") == color]


def test_a_gap_breaks_the_line() -> None:
    timeline = timeline_of(*drive())
    whole = lines_of(figures.speeds(timeline), figures.MEASURED)
    timeline.linear.measured.values[50] = math.nan
    broken = lines_of(figures.speeds(timeline), figures.MEASURED)
    assert len(broken) == len(whole) + 1
    assert not any("nan" in points for points in broken)


def test_a_single_point_makes_no_path() -> None:
    timeline = timeline_of(
        at("tel/odom/odometry", factories.odometry(), 0.0), at("tel/safety/state", state(False), 0)
    )
    drawn = figures.path(timeline) + figures.speeds(timeline)
    assert re.findall(r' d="M[^"L]*"', drawn)
    assert re.findall(r' d="[^"]*L *"', drawn) == []


def test_the_path_in_the_map_has_ellipses_fixes_and_states() -> None:
    timeline = timeline_of(*drive(), *in_the_map())
    drawn = figures.map_path(timeline)
    (ellipse,) = re.findall(r"<ellipse [^>]*>", drawn)
    assert float(attribute(ellipse, "rx")) == pytest.approx(
        2 * float(attribute(ellipse, "ry")), rel=0.02
    )
    assert figures.USED in drawn
    assert figures.REFUSED in drawn
    speeds = figures.speeds(timeline)
    assert all(f">{word}<" in speeds for word in ("map", "placed", "lost"))
    assert ">map<" not in figures.speeds(timeline_of(*drive()))


def attribute(element: str, name: str) -> str:
    found = re.search(rf' {name}="([^"]*)"', element)
    assert found, element
    return found[1]
