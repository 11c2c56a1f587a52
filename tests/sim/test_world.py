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


POST = {"name": "post", "x": 0.2, "y": 0.1, "length": 0.02, "width": 0.02}


@pytest.mark.parametrize(
    ("box", "body", "x", "blocked"),
    [
        (BOX, BODY, 1.49, False),
        (BOX, BODY, 1.51, True),
        (BOX, Rectangle(0.1, 0.1), 3.0, True),  # a small body inside a large box
        (POST, BODY, 0.0, True),  # a large body around a small box
    ],
)
def test_a_box_blocks_a_body(box: dict[str, Any], body: Rectangle, x: float, blocked: bool) -> None:
    assert World.of(room(box)).blocks(body, at(x)) is blocked


@pytest.mark.parametrize("low", [False, True])
def test_a_low_box_is_solid_but_not_seen(low: bool) -> None:
    world = World.of(room(BOX | {"low": low}))
    assert world.blocks(BODY, at(2.0))
    assert world.clearance(BODY, at(0.0)) == (math.inf if low else pytest.approx(1.5))


@pytest.mark.parametrize(
    ("x", "heading", "contact"),
    [
        (1.5 - BUMPER_TRAVEL + 1e-6, 0.0, True),
        (1.5 - BUMPER_TRAVEL - 1e-6, 0.0, False),
        (1.5 - 0.001, math.pi, True),  # the strip goes all around
        (1.75 - 0.001, math.pi / 2, True),
        (1.75 - 0.001, -math.pi / 2, True),
    ],
)
def test_contact_begins_with_the_travel_of_the_strip(
    x: float, heading: float, contact: bool
) -> None:
    assert World.of(room(BOX)).contact(BODY, at(x, heading=heading)) is contact


@pytest.mark.parametrize(
    ("plan", "error"),
    [
        ({"boxes": [BOX | {"x": math.nan}]}, "x"),
        ({"walls": [{"points": [[0, 0]]}]}, "length >= 2"),
        ({"walls": [{"points": [[0, 0], [0, math.inf]]}]}, "float"),
    ],
)
def test_a_wrong_plan_is_refused(plan: dict[str, Any], error: str) -> None:
    with pytest.raises(msgspec.ValidationError, match=error):
        msgspec.convert({"title": "wrong", **plan}, Plan)
