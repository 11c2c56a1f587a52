import math
import statistics
from typing import Any

import pytest

from common.settings import Vehicle
from sim import model
from sim.geometry import Pose
from sim.requests import Sonar
from sim.sonar import Echoes, Sonars
from sim.world import World
from tests.sim.sim_fixture import room

VEHICLE = Vehicle(length=1.0, width=0.6, sonar_min=0.05, sonar_max=4.0)
# x from -2 to 3, y from -1 to 2: every side at another distance.
ROOM = World.of(room(walls=[{"points": [[-2, -1], [3, -1], [3, 2], [-2, 2], [-2, -1]]}]))
HERE = Pose(0.0, 0.0, 0.0)
FAR = [4.0] * 8
WALL_LEFT = [0.6, *[4.0] * 7]  # the manual's order: left, front left, front, ...
LEFT, FRONT_LEFT, FRONT, REAR_LEFT = 0, 1, 2, 7


def sonars(cone: float = 0.0, noise: float = 0.0) -> Sonars:
    return Sonars(VEHICLE, model.Sonar(cone=cone, noise=noise), 1)


def in_front(sonars: Sonars, world: World = ROOM) -> int:
    return sonars.measure(world, HERE)[FRONT]


def test_each_looks_its_own_way() -> None:
    slant = math.sqrt(2)
    ranges = (
        1.7,  # left: 2 to the wall, 0.3 of body
        1.7 * slant,  # front left: at 45 degrees to the upper wall
        2.5,
        0.7 * slant,
        0.7,
        0.7 * slant,
        1.5,
        1.5 * slant,
    )
    assert sonars().measure(ROOM, HERE) == tuple(round(each * 1000) for each in ranges)


def test_a_cone_sees_what_a_ray_would_miss() -> None:
    post = {"name": "post", "x": 2.5, "y": 0.4, "length": 0.1, "width": 0.1}
    world = World.of(room(post))
    assert in_front(sonars(cone=0.0), world) == 4000
    assert 1900 < in_front(sonars(cone=0.6), world) < 2100


COARSE: dict[str, Any] = {"quantum": 0.01, "saturation": 3.0}


@pytest.mark.parametrize(
    ("parameters", "gap", "expected"),
    [
        ({}, 0.049, 0),
        ({}, 0.051, 51),
        ({}, 4.001, 4000),
        (COARSE, 1.236, 1240),
        (COARSE, 9.0, 3000),
    ],
)
def test_the_ends_of_the_range(parameters: dict[str, Any], gap: float, expected: int) -> None:
    wall = room(walls=[{"points": [[0.5 + gap, -9], [0.5 + gap, 9]]}])
    some = Sonars(VEHICLE, model.Sonar(noise=0.0, cone=0.0, **parameters), 1)
    assert in_front(some, World.of(wall)) == expected


def test_noise_is_small_and_around_the_distance() -> None:
    noisy = sonars(noise=0.01)
    values = [in_front(noisy) for _ in range(400)]
    assert statistics.mean(values) == pytest.approx(2500, abs=3)
    assert 8 < statistics.stdev(values) < 12


@pytest.mark.parametrize(
    ("injected", "expected"),
    [
        (Sonar(name="front", fault=True), 0xFFFF),
        (Sonar(name="front", stuck=True), 2500),  # its last range
        (Sonar(name="front", range=1.234), 1234),
    ],
)
def test_a_disturbed_one_comes_back_and_leaves_the_others(injected: Sonar, expected: int) -> None:
    some, nearer = sonars(noise=0.01), Pose(1.0, 0.0, 0.0)
    undisturbed = sonars(noise=0.01)
    for one in (some, undisturbed):
        assert in_front(one) == pytest.approx(2500, abs=50)
    some.inject(injected)
    ranges, others = (one.measure(ROOM, nearer) for one in (some, undisturbed))
    assert ranges[2] == pytest.approx(expected, abs=50)
    assert ranges[:2] + ranges[3:] == others[:2] + others[3:]  # with the same noise
    some.inject(Sonar(name="front"))
    assert some.measure(ROOM, nearer) == undisturbed.measure(ROOM, nearer)


def rounds(distances: list[float], **what: Any) -> list[list[float]]:
    echoes = Echoes(model.Sonar(**what), 1)
    return [echoes.taken(distances) for _ in range(1000)]


def share(found: list[list[float]], index: int, value: float) -> float:
    return sum(each[index] == value for each in found) / len(found)


def test_the_floor_echoes_at_its_range() -> None:
    found = rounds(FAR, floor_chance=0.1, floor_range=1.4)
    assert {value for each in found for value in each} == {4.0, 1.4}
    assert share(found, FRONT, 1.4) == pytest.approx(0.1, abs=0.03)
    some = Sonars(VEHICLE, model.Sonar(noise=0.0, floor_chance=1.0, floor_range=1.5), 1)
    assert in_front(some) == 1500  # and is reported


def test_a_neighbour_s_echo_is_taken_half_of_the_times_if_one_of_two_is_nearer() -> None:
    found = rounds(WALL_LEFT, cross_talk=0.2)
    assert share(found, FRONT_LEFT, 0.6) == pytest.approx(0.1, abs=0.03)
    assert share(found, REAR_LEFT, 0.6) == pytest.approx(0.1, abs=0.03)  # the ring is closed
    assert share(found, FRONT, 4.0) == 1.0  # no neighbour of it is near
    assert share(found, LEFT, 0.6) == 1.0


def test_a_vanished_echo_stays_lost_for_its_readings() -> None:
    found = [each[FRONT] == math.inf for each in rounds(FAR, vanish=0.01, vanish_readings=20)]
    text = "".join("x" if lost else "." for lost in found).rstrip("x").lstrip("x")
    runs = [len(run) for run in text.split(".") if run]
    assert len(runs) > 3
    assert all(run % 20 == 0 for run in runs)  # two of them may follow each other
