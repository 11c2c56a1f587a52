"""The simulated vehicle moves: it obeys, counts, brakes, and goes through nothing."""

import math

import pytest

from common.wire import commands as c
from common.wire import reports as r
from sim import trace as t
from tests.sim.sim_fixture import WALL_AHEAD, SimFixture, model, room

STEP_AHEAD = room({"name": "step", "x": 2.0, "y": 0.0, "length": 0.4, "width": 0.4, "low": True})


def test_counters_are_what_was_really_driven_and_the_distance_has_no_sign() -> None:
    sim = SimFixture()
    sim.run(1.0, 0.5)
    sim.after(10.0)
    sim.stop()
    sim.after(3.0)
    truth = sim.truth
    heading = math.degrees(math.remainder(truth.heading, math.tau))
    assert sim.say(c.DistanceQuery()) == [
        r.DistanceReport(round(truth.distance * 1000), round(heading * 10))
    ]
    assert abs(truth.heading) > math.pi
    sim.run(-1.0)
    sim.after(3.0)
    assert sim.truth.distance > truth.distance + 2.0
    (counted,) = sim.say(c.DistanceQuery())
    assert isinstance(counted, r.DistanceReport)
    assert counted.distance_mm < truth.distance * 1000 - 2000


def test_a_wall_holds_it_and_presses_the_bumper() -> None:
    sim = SimFixture(WALL_AHEAD)
    sim.run(1.0)
    sim.after(4.0)
    assert sim.truth.x == pytest.approx(3.0 - 0.55, abs=1e-3)
    assert sim.truth.clearance == pytest.approx(0.0, abs=1e-3)
    assert (sim.truth.linear, sim.truth.contact) == (0.0, True)
    assert sim.say(c.BumperQuery()) == [r.BumperReport(True)]


def test_a_low_box_gives_no_echo_presses_the_bumper_and_is_backed_off() -> None:
    sim = SimFixture(STEP_AHEAD)
    sim.say(c.BumperBrakeSet(True))
    sim.run(0.5)
    sim.after(4.0)
    (ranges,) = sim.say(c.UltrasonicQuery())
    assert isinstance(ranges, r.UltrasonicReport)
    assert set(ranges.ranges_mm) == {5000}
    touching = sim.truth
    assert (touching.contact, touching.clearance) == (True, None)
    assert sim.simulation.board.braking()
    assert touching.x == pytest.approx(1.8 - 0.55, abs=6e-3)  # the travel of the strip
    sim.run(-0.1)
    sim.after(1.0)
    assert sim.truth.x < touching.x - 0.05
    assert not sim.truth.contact
    assert not sim.simulation.board.braking()


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
