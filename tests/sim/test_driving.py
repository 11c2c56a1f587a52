"""The simulated vehicle moves: it obeys, counts, brakes, and goes through nothing."""

import pytest

from common.wire import commands as c
from common.wire import reports as r
from sim import trace as t
from tests.sim.sim_fixture import WALL_AHEAD, SimFixture, model


def test_a_wall_holds_it_and_presses_the_bumper() -> None:
    sim = SimFixture(WALL_AHEAD)
    sim.run(1.0)
    sim.after(4.0)
    assert sim.truth.x == pytest.approx(3.0 - 0.55, abs=1e-3)
    assert sim.truth.distance == pytest.approx(sim.truth.x, abs=1e-3)
    assert sim.truth.clearance == pytest.approx(0.0, abs=1e-3)
    assert (sim.truth.linear, sim.truth.contact) == (0.0, True)
    assert sim.say(c.BumperQuery()) == [r.BumperReport(True)]
    touching = sim.truth
    sim.run(-1.0)
    sim.after(1.0)
    driven = touching.x - sim.truth.x
    assert driven > 0.3
    assert sim.truth.distance == pytest.approx(touching.distance + driven)  # it has no sign
    counted = round((touching.distance - driven) * 1000)
    assert sim.say(c.DistanceQuery()) == [r.DistanceReport(counted, 0)]


def test_the_sonar_brake_keeps_it_from_the_wall() -> None:
    sim = SimFixture(WALL_AHEAD)
    sim.say(c.UltrasonicBrakeSet(True))
    sim.run(0.3)
    sim.after(15.0)
    assert sim.truth.clearance == pytest.approx(0.14, abs=0.02)
    assert (sim.truth.linear, sim.truth.command.kind) == (0.0, "run")


def test_a_body_rebounds_from_a_wall_and_is_driven_at_it_again() -> None:
    sim = SimFixture(WALL_AHEAD, model(body={"rebound": 0.3}))
    sim.run(0.5)
    sim.after(6.0)
    speeds = [line.linear for line in sim.of(t.Truth)]
    assert -0.15 <= min(speeds) < -0.03
    assert sim.simulation.pose.x > 3.0 - 0.55 - 0.03
