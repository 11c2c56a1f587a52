"""Reaction times of the whole stack: the histograms and the output of ``t2 latency``."""

import json
from pathlib import Path
from typing import Any

import pytest

from common import clock
from common.bus.publisher import host_id
from common.freshness import NS_PER_S
from sim.requests import Bumper
from tests.cli.processes import PATIENCE_S, ran, running, sets, t2
from tests.drive_source import ConstantSource, drive_until_moving, source, stack
from verification.harness.stack import RunningStack
from verification.harness.teleop_terminal import terminal
from verification.harness.waiting import wait_until

__all__ = ["source", "stack"]  # fixtures

pytestmark = pytest.mark.timed

WAYS = {
    "contact_to_break": ["board_to_bridge", "bridge_to_break"],
    "judged_stop": [
        "board_to_bridge", "bridge_to_safety", "in_safety", "safety_to_bridge", "bridge_to_break",
    ],
    "request_to_frame": ["driver_to_safety", "in_safety", "safety_to_bridge", "bridge_to_frame"],
}  # fmt: skip


def latency_once(stack: RunningStack) -> dict[str, Any]:
    """Return what ``t2 latency --once`` prints as JSON."""
    result = ran("latency", "--once", "-o", "json", *sets(f"bus.connect={stack.endpoint}"))
    assert result.returncode == 0, result.stderr
    printed: dict[str, Any] = json.loads(result.stdout)
    return printed


@pytest.mark.skipif(not host_id(), reason="this system does not name its boot: clocks are not one")
def test_a_contact_and_the_requests_before_it_are_measured_hop_by_hop(
    stack: RunningStack, source: ConstantSource, tmp_path: Path
) -> None:
    before = latency_once(stack)["durations"]
    assert before["contact_to_break"] == {"count": 0, "p50": None, "p99": None, "worst": None}
    drive_until_moving(stack, source)
    pressed_ns = clock.now_ns()
    stack.control.do(Bumper(pressed=True))
    lines = tmp_path / "lines"
    with running(t2("latency", "-o", "json", *sets(f"bus.connect={stack.endpoint}")), lines):
        wait_until(lambda: judged(lines), "the judged stop", PATIENCE_S)
    took_s = (clock.now_ns() - pressed_ns) / NS_PER_S
    printed = json.loads(lines.read_text(encoding="utf-8").split("\n")[-2])
    durations = printed["durations"]
    assert durations["contact_to_break"]["count"] == 1
    assert 0 < durations["contact_to_break"]["worst"] < took_s
    assert durations["judged_stop"]["worst"] > durations["contact_to_break"]["worst"]
    assert durations["request_to_frame"]["count"] > 5
    assert durations["board_to_bridge"]["count"] > 50
    assert "foreign_clock" not in printed["not_counted"]
    for way, hops in WAYS.items():
        counts = {durations[f"{way}.{hop}"]["count"] for hop in hops}
        assert counts == {durations[way]["count"]}, way
    for way in ("contact_to_break", "judged_stop"):  # of which there was one
        parts = [durations[f"{way}.{hop}"]["worst"] for hop in WAYS[way]]
        assert sum(parts) == pytest.approx(durations[way]["worst"], abs=1e-6)

    assert_the_terminal_shows(stack, printed["durations"]["contact_to_break"]["worst"])


def judged(lines: Path) -> int:
    """Return how many judged stops the last whole line has counted."""
    whole = lines.read_text(encoding="utf-8").split("\n")[:-1]
    return int(json.loads(whole[-1])["durations"]["judged_stop"]["count"]) if whole else 0


def assert_the_terminal_shows(stack: RunningStack, worst_s: float) -> None:
    """Look at the table that ``t2 latency`` draws on a terminal."""
    words = ["Reactions in ms", "contact → BRAKE, the reflex", f"{worst_s * 1000:.3f}", "p99 ≤",
             "driver → safety"]  # fmt: skip
    with terminal(stack.endpoint, "cli", "latency") as screen:
        wait_until(
            lambda: all(screen.shows(word.encode()) for word in words), "the table", PATIENCE_S
        )
