"""The plan of the guided drive: kinds and numbers of stops, rising speeds, and free space."""

from itertools import groupby, pairwise

import pytest

from cli.commission.manoeuvres import (
    GROUPS,
    Manoeuvre,
    announcement,
    homing,
    missing_stops,
    plan,
    space,
    speed,
)
from common.motion import Twist
from common.settings import Vehicle
from services.safety.config import Safety, SafetyConfig

DEFAULT = SafetyConfig()
SLOW = SafetyConfig(vehicle=Vehicle(max_linear=0.3, max_angular=0.5))
WEAK = SafetyConfig(vehicle=Vehicle(deceleration=0.3), safety=Safety(react=0.5))
PLAN = plan(DEFAULT)


def of(settings: SafetyConfig, title: str) -> Manoeuvre:
    (found,) = (it for it in plan(settings) if it.title == title)
    return found


@pytest.mark.parametrize("settings", [DEFAULT, SLOW, WEAK])
def test_every_kind_of_stop_is_there_with_rising_speeds(settings: SafetyConfig) -> None:
    manoeuvres = plan(settings)
    assert missing_stops(manoeuvres, manoeuvres) == ()
    assert {it.group for it in manoeuvres} | {"return"} == set(GROUPS)
    for it in manoeuvres:
        assert abs(it.twist.linear) <= 0.8 * settings.vehicle.max_linear
        assert abs(it.twist.angular) <= 0.8 * settings.vehicle.max_angular
    moving = [it for it in manoeuvres if not it.twist.is_zero]
    for _, series in groupby(moving, key=lambda it: (it.group, it.ending)):
        for before, after in pairwise(series):
            assert abs(after.twist.linear) >= abs(before.twist.linear)
            assert abs(after.twist.angular) >= abs(before.twist.angular)
    assert sum(it.seconds for it in manoeuvres) < 5 * 60  # the operator needs the other 15 minutes


def test_each_motion_is_followed_by_the_one_back() -> None:
    moving = [it for it in PLAN if it.group in ("straight", "spot", "curve")]
    for there, back in zip(moving[::2], moving[1::2], strict=True):
        assert there.twist.scaled(-1) == back.twist
        assert (there.ending, there.limit) == (back.ending, back.limit)
    assert len(PLAN) == 50


def test_missing_stops_are_counted() -> None:
    some = [it for it in PLAN if it.title != "STOP left from 0.30 rad/s" and it.ending != "brake"]
    assert missing_stops(some, PLAN) == (
        "STOP left: 1 of 6", "BRAKE forward: 3 of 3", "BRAKE backward: 3 of 3",
        "BRAKE left: 3 of 3", "BRAKE right: 3 of 3",
    )  # fmt: skip


def test_what_was_not_planned_is_not_missing() -> None:
    turns = [it for it in PLAN if it.group == "spot"]
    assert missing_stops((), turns) == (
        "STOP left: 6 of 6", "STOP right: 6 of 6", "BRAKE left: 3 of 3", "BRAKE right: 3 of 3",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("settings", "title", "needs"),
    [
        # 1.92 m until it ends, and 0.3 s + 0.27 s at 0.8 m/s, 0.8^2 / 2 / 0.6 m, 0.2 m
        (DEFAULT, "STOP forward from 0.80 m/s", "3.2 m ahead"),
        (DEFAULT, "BRAKE backward from 0.80 m/s", "3.2 m behind"),
        (WEAK, "STOP forward from 0.80 m/s", "3.9 m ahead"),
        (SLOW, "STOP forward from 0.24 m/s", "0.8 m ahead"),
        (DEFAULT, "STOP right from 0.80 rad/s", "0.9 m around the vehicle's middle"),
        (
            DEFAULT,
            "STOP backward turning right from 0.40 m/s, 0.40 rad/s",
            "1.3 m behind and 0.9 m to the left",
        ),
    ],
)
def test_the_free_space_is_stated(settings: SafetyConfig, title: str, needs: str) -> None:
    it = of(settings, title)
    assert space(it) == needs
    assert announcement(it).startswith(f"It needs {needs}. It drives for at most ")


def test_what_is_faster_than_a_limit() -> None:
    it = of(DEFAULT, "STOP left from 0.50 rad/s")
    assert not it.is_faster(Twist(0.0, 0.5))
    assert it.is_faster(Twist(9.0, 0.4))
    assert speed(Twist()) == "0 m/s"


@pytest.mark.parametrize(
    ("travelled", "title", "rate"),
    [
        (0.04, "", 0.0),
        (-0.04, "", 0.0),
        (0.06, "Return backward by 0.06 m", -0.128),  # the ramps leave no room for more
        (2.0, "Return backward by 2.00 m", -0.2),
        (-0.4, "Return forward by 0.40 m", 0.2),
    ],
)
def test_the_way_back(travelled: float, title: str, rate: float) -> None:
    back = homing(travelled, DEFAULT)
    assert (back.title if back else "") == title
    if back:
        assert back.twist.linear == pytest.approx(rate, abs=0.001)
        assert 0 < back.limit.linear < abs(travelled) < back.ahead
