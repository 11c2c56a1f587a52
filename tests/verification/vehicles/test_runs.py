"""A hundred random vehicles; ``make vehicles N=1000`` drives more of them."""

from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from services.safety.zones import Limit, Zones
from verification.vehicles.campaign import read
from verification.vehicles.draw import Draw, draw
from verification.vehicles.judge import Stop
from verification.vehicles.page import page
from verification.vehicles.run import Result, fails_as, run

BATCHES, BATCH = 25, 4

FOUND = msgspec.toml.decode(Path(__file__).with_name("found.toml").read_bytes())["run"]
SHORT = {"operator.manoeuvres": 2}


@pytest.mark.parametrize("batch", range(BATCHES))
def test_no_vehicle_breaks_an_invariant(batch: int) -> None:
    for seed in range(batch * BATCH, (batch + 1) * BATCH):
        result = run(Draw(seed, draw(seed).values | SHORT))
        assert not result.violations, seed
        assert not result.stops, seed


@pytest.mark.parametrize("found", FOUND, ids=[found["found"] for found in FOUND])
def test_what_was_found_stays_fixed(found: dict[str, Any]) -> None:
    result = run(msgspec.convert(found, Draw))
    assert not result.violations
    assert not result.stops
    assert result.finished or result.faulty


def test_a_run_is_the_same_each_time() -> None:
    first, second = (run(Draw(3, draw(3).values | SHORT)) for _ in range(2))
    assert replace(first, cpu_s=0.0) == replace(second, cpu_s=0.0)


def test_a_safety_that_ignores_walls_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Zones, "limit", lambda *_: Limit(1.0))
    assert any(run(draw(seed, faulty=False)).violations for seed in range(10))


def result(seed: int, **fields: object) -> Result:
    usual = Result(
        seed=seed, values={}, faulty=False, violations=[], stops=[], finished=True, seconds=10.0,
        cpu_s=1.0, metres=3.0, contacts=0, errors=[],
    )  # fmt: skip
    return msgspec.convert(msgspec.to_builtins(usual) | msgspec.to_builtins(fields), Result)


def test_a_failure_is_the_same_without_its_numbers() -> None:
    same = fails_as(result(1, violations=["a RUN is held for more than 230 ms"]))
    assert same(result(1, violations=["a RUN is held for more than 380 ms"]))
    assert not same(result(1, violations=["a hit without a BRAKE at once"]))
    stopped = fails_as(result(1, stops=[Stop(1.0, "silent", "")]))
    assert stopped(result(1, stops=[Stop(2.0, "silent", "")]))
    assert not stopped(result(1, stops=[Stop(1.0, "bumper", "")]))
    assert fails_as(result(1, finished=False))(result(1, finished=False))


def test_the_page_names_what_happened(tmp_path: Path) -> None:
    stop = Stop(3.0, "silent", "An input is too old.")
    found = [
        run(draw(0, faulty=False)),
        result(5, stops=[stop]),
        result(6, violations=["safety: too fast"], faulty=True),
        result(7, finished=False, held={"bumper": 80.0}),
        result(8, finished=False, faulty=True, values={"sim.cable.to_pc.drop": 0.3}),
    ]
    file = tmp_path / "runs.jsonl"
    file.write_bytes(b"".join(msgspec.json.encode(one) + b"\n" for one in found))
    assert list(read(file).values()) == found
    text = page(found)
    assert "| `silent` | 1 | 1 | 5 |" in text
    assert "| 6 | none | safety: too fast |" in text
    assert "| 7 | none | the script was not finished, `bumper` for 80 s |" in text
    assert "| 8 | `sim.cable.to_pc.drop` 0.3 | the script was not finished |" in text
    assert "| `sim.cable.to_pc.drop` | 1 | 1 | 8 |" in text
    assert "`sim.drive.slope`" in text
