import msgspec
import pytest

from common.settings import Vehicle
from sim.config import Config
from sim.geometry import Rectangle
from sim.world import World
from verification.vehicles.draw import Draw, Range, draw, ranges
from verification.vehicles.faults import FAULTS
from verification.vehicles.place import plan
from verification.vehicles.shrink import shrink

SEEDS = range(60)
WORLD = {"world.length", "world.width", "world.boxes", "world.step"}
OPERATOR = {"operator.device", "operator.gear", "operator.manoeuvres"}


def ends(one: Range) -> tuple[object, ...]:
    return one.choices or (one.low, one.high)


@pytest.mark.parametrize("one", [one for one in ranges() if one.name.startswith("sim.")])
def test_both_ends_of_a_range_are_settings(one: Range) -> None:
    for value in ends(one):
        assert isinstance(value, bool | int | float | str)
        msgspec.convert(Draw(1, {one.name: value}).settings(), Config)


def test_every_parameter_is_known() -> None:
    others = {one.name for one in ranges() if not one.name.startswith("sim.")}
    faults = {f"fault.{name}" for name in FAULTS}
    assert others == WORLD | OPERATOR | faults
    assert {one.name for one in ranges() if one.fault} >= faults


def test_a_seed_gives_the_same_draw_and_another_seed_another_one() -> None:
    assert draw(7) == draw(7)
    assert draw(7) != draw(8)


def test_a_run_without_faults_has_none() -> None:
    drawn = [draw(seed) for seed in SEEDS]
    assert {one.faulty for one in drawn} == {True, False}
    assert not any(draw(seed, faulty=False).faulty for seed in SEEDS)
    assert all(draw(seed, faulty=True).faulty for seed in SEEDS)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_vehicle_starts_with_room_around_it(seed: int) -> None:
    vehicle = Vehicle()
    found = plan(draw(seed), vehicle)
    body = Rectangle(vehicle.length / 2, vehicle.width / 2)
    assert World.of(found).clearance(body, found.start.pose) > 0.2


def test_the_shrinker_keeps_what_matters() -> None:
    drawn = Draw(1, {"a": 1, "b": 2, "c": 3, "d": 4})

    def fails(one: Draw) -> bool:
        return "b" in one.values and ("c" in one.values or "d" in one.values)

    assert shrink(drawn, fails) == Draw(1, {"b": 2, "d": 4})
