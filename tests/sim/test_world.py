import math
from typing import Any

import msgspec
import pytest

from sim.geometry import Pose, Rectangle
from sim.world import BUMPER_TRAVEL, Plan, World
from tests.sim.sim_fixture import room

BODY = Rectangle(0.5, 0.25)
BOX = {"name": "box", "x": 3.0, "y": 0.0, "length": 2.0, "width": 1.0}


def at(x: float, y: float = 0.0, heading: float = 0.0) -> Pose:
    return Pose(x, y, heading)


def test_walls_are_lines_through_points() -> None:
    world = World.of(room(walls=[{"points": [[0, 0], [1, 0], [1, 2]]}]))
    assert [(s.ax, s.ay, s.bx, s.by) for s in world.visible] == [(0, 0, 1, 0), (1, 0, 1, 2)]


def test_a_box_blocks_from_its_edge_on() -> None:
    world = World.of(room(BOX))
    assert not world.blocks(BODY, at(1.49))
    assert world.blocks(BODY, at(1.51))


def test_a_small_body_inside_a_large_box_is_blocked() -> None:
    assert World.of(room(BOX)).blocks(Rectangle(0.1, 0.1), at(3.0))


def test_a_large_body_around_a_small_box_is_blocked() -> None:
    small = {"name": "post", "x": 0.2, "y": 0.1, "length": 0.02, "width": 0.02}
    assert World.of(room(small)).blocks(BODY, at(0.0))


@pytest.mark.parametrize("low", [False, True])
def test_a_low_box_is_solid_but_not_seen(low: bool) -> None:
    world = World.of(room(BOX | {"low": low}))
    assert world.blocks(BODY, at(2.0))
    assert world.clearance(BODY, at(0.0)) == (math.inf if low else pytest.approx(1.5))


def test_contact_begins_with_the_travel_of_the_strip() -> None:
    world = World.of(room(BOX))
    assert world.contact(BODY, at(1.5 - BUMPER_TRAVEL + 1e-6))
    assert not world.contact(BODY, at(1.5 - BUMPER_TRAVEL - 1e-6))


@pytest.mark.parametrize("heading", [0.0, math.pi / 2, math.pi, -math.pi / 2])
def test_the_strip_goes_all_around(heading: float) -> None:
    reach = 2.0 - (0.5 if abs(math.cos(heading)) > 0.5 else 0.25)
    assert World.of(room(BOX)).contact(BODY, at(reach - 0.001, heading=heading))


@pytest.mark.parametrize(
    ("plan", "error"),
    [
        ({"boxes": [BOX, BOX]}, "same name"),
        ({"boxes": [BOX | {"x": math.nan}]}, "x"),
        ({"walls": [{"points": [[0, 0]]}]}, "length >= 2"),
        ({"walls": [{"points": [[0, 0], [0, math.inf]]}]}, "float"),
    ],
)
def test_a_wrong_plan_is_refused(plan: dict[str, Any], error: str) -> None:
    with pytest.raises(msgspec.ValidationError, match=error):
        msgspec.convert({"title": "wrong", **plan}, Plan)
