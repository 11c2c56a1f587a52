import math
import statistics
from typing import Any

import msgspec
import pytest

from common.freshness import NS_PER_S
from common.motion import Twist
from common.wire import commands as c
from common.wire import reports as r
from sim.board import BREAK, STOP, Board, Switch
from sim.model import Model
from sim.sonar import Ranges

CLEAR: Ranges = (5000, 5000, 5000, 5000, 5000, 5000, 5000, 5000)
FORWARD = c.MotionCommand(c.MotionKind.RUN, 500)
BACKWARD = c.MotionCommand(c.MotionKind.RUN, -100)
TURN = c.MotionCommand(c.MotionKind.RUN, 0, 300)
MS = NS_PER_S // 1000


def board(seed: int = 1, **parameters: Any) -> Board:
    return Board(msgspec.convert(parameters, Model), CLEAR, seed)


def near(*sonars: int, millimetres: int = 100) -> Ranges:
    return tuple(millimetres if k in sonars else 5000 for k in range(8))


def hit(way: float) -> Board:
    """Return a board with its bumper brake on that was hit while moving that way."""
    some = board()
    some.answer(c.BumperBrakeSet(True))
    some.sense(Twist(way), CLEAR, pressed=False)
    some.sense(Twist(), CLEAR, pressed=True)
    return some


def test_each_direction_has_its_angular_unit() -> None:
    wire = {"command_angular_unit": "milliradian", "feedback_angular_unit": "decidegree"}
    some = board(wire=wire)
    assert some.target(c.MotionCommand(c.MotionKind.RUN, 0, 500)) == Twist(0.0, 0.5)
    some.sense(Twist(0.0, math.radians(30)), CLEAR, pressed=False)
    assert some.velocity() == r.VelocityReport(0, 300)
    assert board().target(TURN).angular == pytest.approx(math.radians(30))


@pytest.mark.parametrize(
    ("counted", "report"),
    [
        ([(1.5, 30), (-0.25, -45)], (1250, -150)),  # with their signs
        ([(0.0, 180.2)], (0, -1798)),  # the heading wraps at half a turn
        ([(2147483.648, 0)], (-(2**31), 0)),  # the distance wraps at 32 bits
    ],
)
def test_counters_add_up_and_wrap(
    counted: list[tuple[float, float]], report: tuple[int, int]
) -> None:
    some = board()
    for metres, degrees in counted:
        some.count(metres, math.radians(degrees))
    assert some.answer(c.DistanceQuery()) == r.DistanceReport(*report)


def test_wheels_of_another_size_count_another_distance_and_turn() -> None:
    some = board(counters={"scale": 0.01, "turn_scale": -0.02, "pull": 0.05})
    some.count(2.0, math.radians(90))
    some.count(-1.0, 0.0)
    heading = round(math.degrees(math.radians(90) * 0.98 + 0.05) * 10)
    assert some.answer(c.DistanceQuery()) == r.DistanceReport(1010, heading)


@pytest.mark.parametrize(
    ("command", "rolling", "sonar", "millimetres", "brakes"),
    [
        (FORWARD, 0.0, 1, 100, True),
        (FORWARD, 0.0, 3, 100, True),
        (FORWARD, 0.0, 0, 100, False),
        (BACKWARD, 0.0, 2, 100, False),
        (BACKWARD, 0.0, 5, 100, True),
        (BACKWARD, 0.0, 7, 100, True),
        (BACKWARD, 0.5, 2, 100, True),  # still rolling the other way
        (STOP, 0.5, 2, 100, True),  # coasting
        (TURN, 0.0, 2, 100, False),
        (FORWARD, 0.0, 2, 0, True),
        (FORWARD, 0.0, 2, 149, True),
        (FORWARD, 0.0, 2, 150, False),
        (FORWARD, 0.0, 2, 0xFFFF, False),
    ],
)
def test_the_sonar_brake_watches_the_direction_of_motion(
    command: c.MotionCommand, rolling: float, sonar: int, millimetres: int, brakes: bool
) -> None:
    some = board()
    some.answer(c.UltrasonicBrakeSet(True))
    some.answer(command)
    some.sense(Twist(rolling), near(sonar, millimetres=millimetres), pressed=False)
    assert some.braking() is brakes
    assert some.drive() == (BREAK if brakes else command)


@pytest.mark.parametrize(
    ("way", "command", "brakes"),
    [
        (0.5, TURN, True),
        (0.5, BACKWARD, False),
        (-0.5, BACKWARD, True),
        (-0.5, FORWARD, False),
        (0.0, BACKWARD, True),  # pressed by hand while it had never moved
    ],
)
def test_the_bumper_brake_lets_it_only_back_off(
    way: float, command: c.MotionCommand, brakes: bool
) -> None:
    some = hit(way)
    some.answer(command)
    assert some.braking() is brakes


def test_the_bumper_brake_remembers_the_way_of_the_hit_until_the_release() -> None:
    some = hit(0.5)
    some.answer(BACKWARD)
    some.sense(Twist(-0.1), CLEAR, pressed=True)
    assert not some.braking()
    some.answer(FORWARD)
    assert some.braking()
    some.sense(Twist(), CLEAR, pressed=False)
    assert some.drive() == FORWARD


def test_velocities_with_noise_and_bias() -> None:
    error = {"noise": 0.02, "angular_noise": 0.03, "bias": 0.01, "angular_bias": -0.02}
    some = board(velocity=error)
    some.sense(Twist(0.5, 0.1), CLEAR, pressed=False)
    reports = [some.velocity() for _ in range(2000)]
    linear = [report.linear_mmps / 1000 for report in reports]
    angular = [math.radians(report.angular_raw / 10) for report in reports]
    assert statistics.mean(linear) == pytest.approx(0.51, abs=0.002)
    assert statistics.stdev(linear) == pytest.approx(0.02, abs=0.002)
    assert statistics.mean(angular) == pytest.approx(0.08, abs=0.003)
    assert statistics.stdev(angular) == pytest.approx(0.03, abs=0.003)


def test_after_each_change_it_opens_and_closes_for_its_time() -> None:
    switch = Switch(0.1, 1)
    for begin_ms, touched in ((0, True), (1000, False)):
        switch.touch(touched, begin_ms * MS)
        assert switch.closed is touched
        seen = []
        for after_ms in range(1, 100):
            switch.touch(touched, (begin_ms + after_ms) * MS)
            seen.append(switch.closed)
        assert 30 < sum(seen) < 70
        for after_ms in (100, 500):
            switch.touch(touched, (begin_ms + after_ms) * MS)
            assert switch.closed is touched
