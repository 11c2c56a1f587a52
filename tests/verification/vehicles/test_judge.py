import math

import pytest
from msgspec.structs import replace

from common import messages as m
from common.freshness import NS_PER_S
from sim.config import Config
from sim.geometry import Pose
from sim.trace import Truth
from sim.world import Plan
from tests.factories import safety_state
from verification.invariants.net import Net
from verification.invariants.oracle import Oracle
from verification.invariants.process import Process
from verification.vehicles.draw import Draw
from verification.vehicles.judge import Judge, normalised, pose_error
from verification.vehicles.operator import Operator
from verification.vehicles.vehicle import SimulatedVehicle

START_NS = 100 * NS_PER_S
NOW_NS = START_NS + 10 * NS_PER_S


def cause(name: str, action: m.Action = "stop", number: int = 1) -> m.Cause:
    return m.Cause(name=name, action=action, age=0.0, text=f"{name}.", id=number)


def operator(*causes: m.Cause, asks: bool = True) -> Operator:
    made = Operator(Process("stick", Net(START_NS), None, 1, Oracle(START_NS)), Draw(1, {}))
    made.seen = safety_state(causes=causes)
    made.asks_since_ns = START_NS if asks else None
    return made


@pytest.fixture
def truth() -> Truth:
    net = Net(START_NS)
    vehicle = SimulatedVehicle(net, lambda *_: None, Config(), Plan(title="a plane"))
    return vehicle.truth


@pytest.mark.parametrize("name", ["blocked", "contact", "bumper", "silent", "not_stopping"])
def test_a_stop_on_an_empty_plane_is_needless(truth: Truth, name: str) -> None:
    judge = Judge(START_NS)
    judge.look(operator(cause(name)), truth, NOW_NS)
    judge.look(operator(cause(name)), truth, NOW_NS + 1)
    assert [(stop.at_s, stop.cause) for stop in judge.stops] == [(10.0, name)]


def test_a_wall_justifies_blocked_and_a_touch_contact(truth: Truth) -> None:
    judge = Judge(START_NS)
    judge.look(operator(cause("blocked")), replace(truth, clearance=0.3), NOW_NS)
    judge.look(operator(cause("contact", "brake", 2)), replace(truth, contact=True), NOW_NS)
    judge.look(operator(cause("neutral", number=3)), truth, NOW_NS)
    judge.look(operator(cause("sonar", "slow", 4)), truth, NOW_NS)
    assert judge.stops == []


def test_a_wall_does_not_justify_other_causes(truth: Truth) -> None:
    judge = Judge(START_NS)
    judge.look(operator(cause("silent")), replace(truth, clearance=0.1, contact=True), NOW_NS)
    assert [stop.cause for stop in judge.stops] == ["silent"]


def test_a_slope_justifies_the_brake_for_a_roll(truth: Truth) -> None:
    judge = Judge(START_NS)
    judge.look(operator(), truth, NOW_NS)
    neutral = replace(truth.command, kind="run")
    rolling = replace(truth, linear=0.2, distance=truth.distance + 0.04, command=neutral)
    judge.look(operator(), rolling, NOW_NS + 1)
    stands = replace(rolling, linear=0.0)
    seen = cause("not_stopping"), cause("uncommanded_motion", "brake", 2)
    judge.look(operator(*seen), stands, NOW_NS + 2)
    assert judge.stops == []


def test_nobody_is_blocked_who_asks_for_nothing(truth: Truth) -> None:
    judge = Judge(START_NS)
    judge.look(operator(cause("blocked"), cause("no_request"), asks=False), truth, NOW_NS)
    judge.look(operator(cause("starting")), truth, START_NS + NS_PER_S)  # coming up
    assert judge.stops == []


def test_the_squared_error_in_units_of_its_covariance() -> None:
    assert normalised((0.2, 0.1, 0.0), (0.04, 0, 0, 0, 0.01, 0, 0, 0, 1)) == pytest.approx(2.0)
    # Correlated: the inverse of [[2, 1, 0], [1, 2, 0], [0, 0, 1]] is [[2, -1], [-1, 2]] / 3.
    assert normalised((1, 1, 2), (2, 1, 0, 1, 2, 0, 0, 0, 1)) == pytest.approx(2 / 3 + 4)


def test_the_error_is_taken_in_the_frame_of_the_start() -> None:
    odometry = m.Odometry(
        x=1.0, y=0.0, heading=math.pi / 2, linear=0.0, angular=0.0,
        pose_covariance=(1, 0, 0, 0, 1, 0, 0, 0, 1), twist_covariance=(1, 0, 0, 1),
        epoch=0, residual=None, slip=False,
    )  # fmt: skip
    error = pose_error(odometry, Pose(3.0, 5.1, math.pi), Pose(3.0, 4.0, math.pi / 2))
    assert error.position == pytest.approx(0.1)
    assert error.heading == pytest.approx(0.0)
    assert error.nees == pytest.approx(0.01)
