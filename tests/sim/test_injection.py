import math
from typing import Any

import msgspec
import pytest

from sim import requests as q
from tests.sim.sim_fixture import START_NS, SimFixture, room

BOX: dict[str, Any] = {"name": "crate", "x": 3.0, "y": 0.0, "length": 1.0, "width": 1.0}


def test_a_hand_does_not_lift_the_bumper_off_an_obstacle() -> None:
    sim = SimFixture(room(BOX))
    sim.do(q.Place(x=2.5 - 0.55 - 0.001, y=0.0))
    sim.do(q.Bumper(pressed=False))
    assert sim.truth.pressed


@pytest.mark.parametrize(
    ("direction", "to_pc", "to_board"),
    [("to_pc", 1.0, 0.0), ("to_board", 0.0, 1.0), ("both", 1.0, 1.0)],
)
def test_the_cable_is_disturbed_one_way_or_both(
    direction: str, to_pc: float, to_board: float
) -> None:
    sim = SimFixture()
    sim.do(msgspec.convert({"do": "wire", "direction": direction, "drop": 1.0}, q.Wire))
    assert sim.simulation.to_pc.faults.drop == to_pc
    assert sim.simulation.to_board.faults.drop == to_board


def test_it_is_placed_and_stands_there() -> None:
    sim = SimFixture()
    sim.run(1.0)
    sim.after(1.0)
    sim.stop()
    assert sim.do(q.Place(x=-3.0, y=2.0, heading=math.pi)).ok
    assert (sim.truth.x, sim.truth.y, sim.truth.linear) == (-3.0, 2.0, 0.0)


def test_a_refused_request_changes_nothing_and_is_traced_with_its_reason() -> None:
    sim = SimFixture(room(BOX))
    reply = sim.do(q.Place(x=3.0, y=0.0))
    assert (reply.ok, reply.error) == (False, "an obstacle is at x 3, y 0")
    assert sim.do(q.GetTruth()).truth == sim.truth  # which leaves no line
    assert sim.truth.x == 0.0
    assert msgspec.to_builtins(sim.records) == [
        {
            "event": "fault",
            "mono_ns": START_NS,
            "request": {"do": "place", "x": 3.0, "y": 0.0, "heading": 0.0},
            "error": "an obstacle is at x 3, y 0",
        }
    ]
