"""The proof of patrol: vehicles that drive their rounds, and faults that the judge must find."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from services.patrol.core import course
from sim import requests as q
from verification.patrol.run import Trial, measure
from verification.search.draw import Draw

pytestmark = pytest.mark.simulated

SEED = 2  # its route is short


@pytest.mark.parametrize("seed", [142, 147])
def test_a_round_ends_as_it_must(seed: int) -> None:
    found = measure(seed)
    assert not found.broken
    assert not found.unexpected
    assert found.seconds > 10


def displace(trial: Trial) -> None:
    """Put the vehicle beside its way, which only the truth shows."""
    pose = trial.stack.vehicle.simulation.pose
    x, y = pose.outward(0.0, 1.5)
    trial.stack.vehicle.inject(q.Place(x=x, y=y, heading=pose.heading))


def press_estop(trial: Trial) -> None:
    trial.stack.estop()


@pytest.mark.parametrize(
    ("incident", "rules", "found"),
    [
        (displace, course.RULES, "outside without a stop"),
        (press_estop, (), "motion after a latch"),
    ],
)
def test_the_judge_finds_what_patrol_does_not_stop(
    incident: Callable[[Trial], None],
    rules: tuple[Any, ...],
    found: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(course, "RULES", rules)
    trial = Trial(Draw(SEED, {}), tmp_path)
    trial.add(4.0, incident)
    trial.drive(longest_s=25.0)
    assert [each for each in trial.judge.violations if each.startswith(found)]
