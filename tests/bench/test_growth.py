"""Benchmark ``growth``: a small run, and how steep made-up curves are."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest

from bench.growth import measure, page
from bench.growth.page import Point, steepest
from bench.load.board import compiled
from tests.bench.growth_series import made_up


def curve(*costs: float) -> list[Point]:
    """Return a curve over 1, 2, 4, 8, ..."""
    return [(2.0**index, cost) for index, cost in enumerate(costs)]


@pytest.mark.parametrize(
    ("points", "ratio"),
    [
        (curve(3), 0.0),
        (curve(1, 2, 4, 8), 1.0),  # proportional
        (curve(5, 5, 5, 5), 0.5),
        (curve(1, 4, 16), 4.0),
        (curve(1, 1, 1, 9), 4.5),
        (curve(1, 9, 9, 9), 1.125),  # proportional again later
        (curve(0, 1, 4), 2.0),  # no ratio to zero
        ([(10.0, 400.0), (1.0, 1.0)], 40.0),  # in any order
    ],
)
def test_how_steep_a_curve_is(points: Sequence[Point], ratio: float) -> None:
    assert steepest(points) == pytest.approx(ratio)


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
@pytest.mark.campaign
def test_consumers_and_sizes_are_measured_at_a_real_bridge(tmp_path: Path) -> None:
    with measure.robot(compiled(tmp_path)) as it:
        made = measure.consumers(it, (1,), 0.3) + measure.sizes(it, (1000,), 0.3)
    by_name = {one.name: one for one in made}
    for name, number in ((page.CONSUMERS, "1"), (page.SIZES, "1000")):
        delay = by_name[name, number, "delay"]
        assert delay.samples_ns
        assert all(0 < ns < 1e10 for ns in delay.samples_ns)
        assert page.points(by_name, name, "bridge")


def test_the_last_row_of_a_curve_has_the_verdict() -> None:
    rows = page.blocks(made_up())["table"].splitlines()
    assert rows[2:5] == [
        "| 1 | consumers | 0.0 | - | 1 | 1 |  |  |",
        "| 10 | consumers | 0.0 | - | 2 | 2 |  |  |",
        "| 100 | consumers | 0.0 | - | 90 | 90 | 7% arrived | 0 of 2 reached, worst "
        "× 4.50 of × 1.25 |",
    ]


def test_what_did_not_arrive_is_noted() -> None:
    delay, router = measure.point((page.SIZES, "3"), {"router": 5}, [1, 2], 0.5)
    assert (delay.note, router.note) == ("50% arrived", "")
    assert measure.point((page.SIZES, "3"), {}, [], 0.99)[0].note == ""


def test_a_bridge_that_was_gone_has_no_figure() -> None:
    made = measure.point((page.CONSUMERS, "1"), {"router": 1, "bridge": 10_000_000}, [1], 1.0)
    made += measure.point((page.CONSUMERS, "2"), {"router": 1}, [], 1.0)
    rows = page.cost_table({one.name: one for one in made}, []).splitlines()
    assert [row.split(" | ")[3] for row in rows[2:]] == ["1.0", "-"]
    assert rows[3].split(" | ")[4:6] == ["-", "-"]
