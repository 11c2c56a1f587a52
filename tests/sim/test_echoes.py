import math
from typing import Any

import pytest

from sim.config import Sonar
from sim.echoes import Echoes

FAR = [4.0] * 8
WALL_LEFT = [0.6, *[4.0] * 7]  # the manual's order: left, front left, front, ...
LEFT, FRONT_LEFT, FRONT, REAR_LEFT = 0, 1, 2, 7


def rounds(
    distances: list[float], count: int = 1000, seed: int = 1, **what: Any
) -> list[list[float]]:
    echoes = Echoes(Sonar(**what), seed)
    return [echoes.taken(distances) for _ in range(count)]


def share(found: list[list[float]], index: int, value: float) -> float:
    return sum(each[index] == value for each in found) / len(found)


def test_kind_ones_take_the_first_echo() -> None:
    assert rounds(WALL_LEFT) == [WALL_LEFT] * 1000


def test_the_floor_echoes_at_its_range() -> None:
    found = rounds(FAR, floor_chance=0.1, floor_range=1.4)
    assert {value for each in found for value in each} == {4.0, 1.4}
    assert share(found, FRONT, 1.4) == pytest.approx(0.1, abs=0.03)


def test_the_floor_hides_nothing_that_is_nearer() -> None:
    assert share(rounds(WALL_LEFT, floor_chance=1.0, floor_range=1.4), LEFT, 0.6) == 1.0


def test_a_neighbour_s_echo_is_taken_half_of_the_times_if_one_of_two_is_nearer() -> None:
    found = rounds(WALL_LEFT, cross_talk=0.2)
    assert share(found, FRONT_LEFT, 0.6) == pytest.approx(0.1, abs=0.03)
    assert share(found, REAR_LEFT, 0.6) == pytest.approx(0.1, abs=0.03)  # the ring is closed
    assert share(found, FRONT, 4.0) == 1.0  # no neighbour of it is near
    assert share(found, LEFT, 0.6) == 1.0


def test_an_echo_vanishes() -> None:
    found = rounds(FAR, vanish=0.3)
    assert share(found, FRONT, math.inf) == pytest.approx(0.3, abs=0.05)


def test_a_vanished_echo_stays_lost_for_its_readings() -> None:
    found = [each[FRONT] == math.inf for each in rounds(FAR, vanish=0.01, vanish_readings=20)]
    text = "".join("x" if lost else "." for lost in found).rstrip("x").lstrip("x")
    runs = [len(run) for run in text.split(".") if run]
    assert len(runs) > 3
    assert all(run % 20 == 0 for run in runs)  # two of them may follow each other


def test_each_effect_draws_for_itself_and_the_same_seed_draws_the_same() -> None:
    what: dict[str, Any] = {"floor_chance": 0.1, "cross_talk": 0.1, "vanish": 0.1}
    assert rounds(WALL_LEFT, **what) == rounds(WALL_LEFT, **what)
    assert rounds(WALL_LEFT, **what) != rounds(WALL_LEFT, seed=2, **what)
