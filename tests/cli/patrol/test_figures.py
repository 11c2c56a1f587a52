"""The corridor of a report is to scale."""

import re

import pytest

from cli.patrol import figures
from tests.cli.patrol.fake_patrol import ROUND, TRACK, YARD


def test_the_corridor_is_as_wide_as_it_is_in_the_map() -> None:
    """The route is 3 m long from left to right, and its corridor 1 m wide."""
    drawn = figures.path(ROUND, YARD, TRACK)
    band = re.search(rf'd="([^"]*)" stroke="{figures.CORRIDOR}" stroke-width="([\d.]+)"', drawn)
    assert band is not None
    xs = [float(x) for x in re.findall(r"([\d.]+),", band[1])]
    assert float(band[2]) == pytest.approx((max(xs) - min(xs)) / 3, rel=0.01)
