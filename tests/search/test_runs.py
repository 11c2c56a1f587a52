"""Two hundred random vehicles; ``make vehicles N=1000`` drives more of them."""

from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from services.safety.core.planning import SonarLimit, Zones
from services.teleop.core.hold import Deadman
from verification.search.draw import Draw, Value, draw, ranges
from verification.search.run import run

BATCHES, BATCH = 25, 8
FOUND = msgspec.toml.decode(Path(__file__).with_name("found.toml").read_bytes())["run"]
SOUND = [seed for seed in range(20) if not draw(seed).faulty]
SHORT = {"operator.manoeuvres": 2}


@pytest.mark.parametrize("batch", range(BATCHES))
def test_no_vehicle_breaks_an_invariant(batch: int) -> None:
    for seed in range(batch * BATCH, (batch + 1) * BATCH):
        drawn = draw(seed)
        manoeuvres = 2 if drawn.faulty else 1  # faults begin after some seconds
        result = run(Draw(seed, drawn.values | {"operator.manoeuvres": manoeuvres}))
        assert not result.violations, seed
        assert not result.stops, seed


@pytest.mark.parametrize("found", FOUND, ids=[found["found"] for found in FOUND])
def test_what_was_found_stays_fixed(found: dict[str, Any]) -> None:
    result = run(msgspec.convert(found, Draw))
    assert not result.violations
    assert not result.stops
    assert result.finished or result.faulty


def test_taps_come_beside_lost_answers_only() -> None:
    (tapped,) = [one for one in ranges() if one.beside]
    draws = [set(draw(seed).values) for seed in range(200)]
    found = [names for names in draws if tapped.name in names]
    assert found
    assert all(names & set(tapped.beside) for names in found)


def test_a_run_is_the_same_each_time() -> None:
    first, second = (run(Draw(3, draw(3).values | SHORT)) for _ in range(2))
    assert replace(first, cpu_s=0.0) == replace(second, cpu_s=0.0)


def test_a_safety_that_ignores_walls_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Zones, "limit", lambda *_: SonarLimit(1.0))
    assert any(run(draw(seed)).violations for seed in SOUND)


@pytest.mark.parametrize("is_released", [True, False])
def test_a_frozen_gamepad_that_drives_is_found(
    is_released: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not is_released:
        monkeypatch.setattr(Deadman, "is_silent", lambda *_: False)
    frozen: dict[str, Value] = {
        "operator.device": "gamepad",
        "operator.manoeuvres": 2,
        "fault.gamepad_frozen": 2.0,
    }
    result = run(Draw(6, frozen))
    assert result.violations == ([] if is_released else ["a frozen gamepad drives"])
