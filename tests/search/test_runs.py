"""Two hundred random vehicles; ``make vehicles N=1000`` drives more of them."""

import math
from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from common import messages as m
from common.freshness import NS_PER_S
from common.settings import Vehicle
from services.safety.core.planning import SonarLimit, Zones
from sim.geometry import Pose, Rectangle
from sim.trace import Truth
from sim.world import World
from verification.search.draw import Draw, draw, ranges, room
from verification.search.judge import Judge, Stop, normalised, pose_error
from verification.search.page import page
from verification.search.run import FAULTS, Result, run
from verification.search.stack import START_NS, Stack

BATCHES, BATCH = 25, 8
FOUND = msgspec.toml.decode(Path(__file__).with_name("found.toml").read_bytes())["run"]
SOUND = [seed for seed in range(20) if not draw(seed).faulty]
SHORT = {"operator.manoeuvres": 2}
OTHERS = {
    "world.length", "world.width", "world.boxes", "world.step",
    "operator.device", "operator.gear", "operator.manoeuvres",
}  # fmt: skip
NOW_NS = START_NS + 10 * NS_PER_S


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


def test_a_run_is_the_same_each_time() -> None:
    first, second = (run(Draw(3, draw(3).values | SHORT)) for _ in range(2))
    assert replace(first, cpu_s=0.0) == replace(second, cpu_s=0.0)


def test_a_safety_that_ignores_walls_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Zones, "limit", lambda *_: SonarLimit(1.0))
    assert any(run(draw(seed)).violations for seed in SOUND)


# --- the draw -------------------------------------------------------------------------------------


def test_every_parameter_is_known_and_both_ends_of_its_range_are_settings() -> None:
    others = {one.name for one in ranges() if not one.name.startswith("sim.")}
    assert others == OTHERS | FAULTS.keys()
    assert {one.name for one in ranges() if one.fault} >= FAULTS.keys()
    for one in ranges():
        for value in one.choices or (one.low, one.high):
            assert isinstance(value, bool | int | float | str)
            Draw(1, {one.name: value}).model()


def test_a_seed_gives_the_same_draw() -> None:
    assert draw(7) == draw(7) != draw(8)
    assert {draw(seed).faulty for seed in range(20)} == {True, False}


def test_the_vehicle_starts_with_room_around_it() -> None:
    vehicle = Vehicle()
    body = Rectangle(vehicle.length / 2, vehicle.width / 2)
    for seed in range(60):
        found = room(draw(seed), vehicle)
        assert World.of(found).clearance(body, found.start.pose) > 0.2, seed


# --- the judge ------------------------------------------------------------------------------------


def cause(name: str, action: m.Action = "stop", number: int = 1) -> m.Cause:
    return m.Cause(name=name, action=action, age=0.0, text=f"{name}.", id=number)


class Judged:
    """A judge, and what it looks at: nothing is near, and the operator asks for motion."""

    def __init__(self) -> None:
        self.judge = Judge(START_NS)
        self.truth: Truth = Stack().vehicle.truth
        self.asks_since_ns: int | None = START_NS

    def look(self, *causes: m.Cause, now_ns: int = NOW_NS, **truth: Any) -> list[str]:
        """Return the causes of all needless stops."""
        self.truth = replace(self.truth, **truth)
        self.judge.look(causes, self.asks_since_ns, self.truth, now_ns)
        return [stop.cause for stop in self.judge.stops]


@pytest.mark.parametrize("name", ["blocked", "contact", "bumper", "silent", "not_stopping"])
def test_a_stop_on_an_empty_plane_is_needless_and_counts_once(name: str) -> None:
    judged = Judged()
    judged.look(cause(name))
    assert judged.look(cause(name), now_ns=NOW_NS + 1) == [name]


def test_a_wall_justifies_blocked_and_a_touch_contact_and_neither_others() -> None:
    judged = Judged()
    judged.look(cause("blocked"), clearance=0.3)
    judged.look(cause("contact", "brake", 2), contact=True)
    judged.look(cause("neutral", number=3), cause("sonar", "slow", 4))
    assert judged.look(cause("silent", number=5), clearance=0.1) == ["silent"]


def test_a_slope_justifies_the_brake_for_a_roll() -> None:
    judged = Judged()
    judged.look()
    neutral = replace(judged.truth.command, kind="run")
    judged.look(now_ns=NOW_NS + 1, linear=0.2, distance=0.04, command=neutral)
    seen = cause("not_stopping"), cause("uncommanded_motion", "brake", 2)
    assert judged.look(*seen, now_ns=NOW_NS + 2, linear=0.0) == []


def test_nobody_is_blocked_who_asks_for_nothing() -> None:
    judged = Judged()
    judged.asks_since_ns = None
    judged.look(cause("blocked"), cause("no_request"))
    assert judged.look(cause("starting"), now_ns=START_NS + NS_PER_S) == []  # coming up


def test_the_error_of_odometry_is_taken_in_the_frame_of_the_start() -> None:
    odometry = m.Odometry(
        x=1.0, y=0.0, heading=math.pi / 2, linear=0.0, angular=0.0,
        pose_covariance=(1, 0, 0, 0, 1, 0, 0, 0, 1), twist_covariance=(1, 0, 0, 1),
        epoch=0, residual=None, slip=False,
    )  # fmt: skip
    error = pose_error(odometry, Pose(3.0, 5.1, math.pi), Pose(3.0, 4.0, math.pi / 2))
    assert error.position == pytest.approx(0.1)
    assert error.heading == pytest.approx(0.0)
    assert error.nees == pytest.approx(0.01)
    # Correlated: the inverse of [[2, 1, 0], [1, 2, 0], [0, 0, 1]] is [[2, -1], [-1, 2]] / 3.
    assert normalised((1, 1, 2), (2, 1, 0, 1, 2, 0, 0, 0, 1)) == pytest.approx(2 / 3 + 4)


# --- the page -------------------------------------------------------------------------------------


def result(seed: int, **fields: Any) -> Result:
    usual = Result(
        seed=seed, values={}, faulty=False, violations=[], stops=[], finished=True, seconds=10.0,
        cpu_s=1.0, metres=3.0, contacts=0, error=None,
    )  # fmt: skip
    return replace(usual, **fields)


def test_the_page_names_what_happened() -> None:
    text = page(
        [
            run(Draw(SOUND[0], draw(SOUND[0]).values | SHORT)),
            result(5, stops=[Stop(3.0, "silent", "An input is too old.")]),
            result(6, violations=["safety: too fast"], faulty=True),
            result(7, finished=False, held={"bumper": 80.0}),
            result(8, finished=False, faulty=True, values={"sim.cable.to_pc.drop": 0.3}),
        ]
    )
    assert "| 5 | none | 3.0 s: An input is too old. |" in text
    assert "| 6 | none | safety: too fast |" in text
    assert "| 7 | none | the script was not finished, `bumper` for 80 s |" in text
    assert "| 8 | `sim.cable.to_pc.drop` 0.3 | the script was not finished |" in text
