"""Benchmark ``growth``: small runs, and where made-up curves bend."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest

from bench.growth import measure, page
from bench.growth.page import Point, bend
from bench.load.board import compiled
from tests.bench.growth_series import made_up
from verification.harness.bus import router_process
from verification.harness.child_process import ChildProcess
from verification.harness.ports import free_port


def curve(*costs: float) -> list[Point]:
    """Return a curve over 1, 2, 4, 8, ..."""
    return [(2.0**index, cost) for index, cost in enumerate(costs)]


@pytest.mark.parametrize(
    ("points", "at"),
    [
        ([], None),
        (curve(3), None),
        (curve(1, 2, 4, 8, 16), None),  # proportional
        (curve(5, 5, 5, 5, 5), None),
        (curve(5, 6, 8, 12, 20), None),  # the growing share is small
        (curve(1, 4, 16, 64, 256), 1),
        (curve(4, 4, 5, 20, 80), 4),
        (curve(1, 1, 1, 1, 9), 8),
        (curve(1, 9, 9, 9, 9), None),  # proportional again later
        (curve(1, 2.4, 4.8, 9.6), None),  # within the margin
        (curve(1, 2.6, 5.2, 10.4), 1),  # beyond the margin from then on
        (curve(0, 1, 4, 16), 2),  # no ratio to zero
        ([(10.0, 400.0), (1.0, 1.0)], 1),  # in any order
    ],
)
def test_where_a_curve_bends(points: Sequence[Point], at: float | None) -> None:
    assert bend(points) == at


@pytest.mark.campaign
def test_the_publisher_pair_measures_ages() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with (
        router_process(endpoint),
        ChildProcess("bench.growth.publisher_pair", endpoint, "3", "100", "500") as pair,
    ):
        found = pair.end()
        while len(found["ages_ns"]) < 10:
            found = pair.end()
    assert all(0 < ns < 1e10 for ns in found["ages_ns"])
    assert 0 < found["arrived"] <= 1
    assert found["declared_s"] > 0


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
@pytest.mark.campaign
def test_consumers_and_sizes_are_measured_at_a_real_bridge(tmp_path: Path) -> None:
    with measure.robot(compiled(tmp_path)) as it:
        made = measure.consumers(it, (1, 2), 0.5)
        made += measure.pairs(it, page.SIZES, (16, 100_000), 0.5)
    by_name = {one.name: one for one in made}
    for name, number in ((page.CONSUMERS, 2), (page.SIZES, 100_000)):
        assert by_name[name, str(number), "delay"].samples_ns
        assert page.points(by_name, name, "bridge")


@pytest.mark.campaign
def test_robots_are_measured_at_a_real_router() -> None:
    made = {one.name: one for one in measure.robots((2,), 1.0)}
    assert len(made[page.ROBOTS, "2", "delay"].samples_ns) > 10
    assert {name[2] for name in made} == {"delay", "router", "machine"}


def test_a_table_names_where_it_bends() -> None:
    blocks = page.blocks(made_up())
    assert blocks["consumers"].splitlines() == [
        "| consumers | router CPU % | delay p50 us | p99 us |  |",
        "| --- | --- | --- | --- | --- |",
        "| 1 | 0.0 | 1 | 1 |  |",
        "| 10 | 0.0 | 2 | 2 |  |",
        "| 100 | 0.0 | 90 | 90 | 7% arrived |",
        "",
        "Grows faster than the number of consumers: CPU of the router: from 10 on; "
        "delay, p50: from 10 on; delay, p99: from 10 on.",
    ]
    assert "| 10 | 0.0 | - | - |  |" in blocks["robots"]
    assert blocks["robots"].endswith("CPU of the router: from 10 on.")


def test_what_did_not_arrive_is_noted() -> None:
    delay, router = measure.point((page.KEYS, "3"), {"router": 5}, [1, 2], 0.5, "1.0 s to declare")
    assert (delay.note, router.note) == ("50% arrived", "")
    assert measure.point((page.KEYS, "3"), {}, [], 0.99, "so")[0].note == "so"


def test_a_bridge_that_was_gone_has_no_figure() -> None:
    made = measure.point((page.CONSUMERS, "1"), {"router": 1, "bridge": 10_000_000}, [1], 1.0)
    made += measure.point((page.CONSUMERS, "2"), {"router": 1}, [1], 1.0)
    rows = page.cost_table({one.name: one for one in made}, page.CONSUMERS).splitlines()
    assert [row.split(" | ")[2] for row in rows[2:]] == ["1.0", "-"]
