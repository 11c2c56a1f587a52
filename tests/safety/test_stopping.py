"""Standstill supervision through the whole decision."""

import math

import pytest
from msgspec.structs import replace

from common.freshness import NS_PER_S
from tests.safety.policy_fixture import TICK_S, Scene, hit


def until(scene: Scene, command: str) -> None:
    """Let time pass until safety commands it."""
    for _ in range(200):
        if scene.tick().command == command:
            return
    raise AssertionError(scene.state.latches)


@pytest.mark.parametrize(("linear", "angular"), [(0.28, 0.0), (0.0, 0.49)])
def test_a_stop_that_does_not_stop_becomes_a_brake(linear: float, angular: float) -> None:
    scene = Scene().running(linear, angular)
    scene.linear, scene.angular = linear, angular
    bound_s = max(linear / 0.6, angular / 1.0) + 0.5
    until(scene, "stop")
    began_ns = scene.now_ns
    until(scene, "brake")
    assert scene.now_ns - began_ns <= (bound_s + 3 * TICK_S) * NS_PER_S
    assert f"{linear:.2f} m/s" in scene.state.latches["not_stopping"].text
    assert scene.tick(500).name == "brake"
    scene.linear, scene.angular = 0.0, 0.0
    assert scene.drive(0.3, seconds=1.0).command == "stop"  # a neutral request first
    scene.linear = scene.angular = None
    scene.drive()
    assert scene.drive(0.3).command == "run"


def test_a_request_of_zero_commands_standstill_as_well() -> None:
    scene = Scene().ready()
    scene.drive(seconds=1.0)
    scene.linear = 0.28
    assert scene.drive(seconds=0.5).command == "brake"
    assert "uncommanded_motion" in scene.state.latches


@pytest.mark.parametrize(
    ("linear", "angular", "moving"),
    [(1e-4, 0.0, False), (-4e-4, 8e-4, False), (6e-4, 0.0, True), (0.0, -9e-4, True)],
)
def test_a_request_that_the_board_gets_as_zero_commands_standstill(
    linear: float, angular: float, moving: bool
) -> None:
    scene = Scene().ready()
    scene.drive(seconds=1.0)
    scene.linear = scene.angular = 0.0
    scene.drive(linear, angular, seconds=1.0)
    assert scene.verdict.command == "run"
    scene.linear = 0.09
    assert (scene.drive(linear, angular, seconds=1.5).command == "run") is moving


def test_a_pushed_vehicle_latches_until_a_reset() -> None:
    scene = Scene().ready()
    scene.tick(50)
    scene.linear = 0.3
    assert scene.tick(20).command == "brake"
    scene.linear = 0.0
    assert scene.tick(100).command == "brake"
    assert scene.reset() == ""
    scene.linear = None
    scene.drive()
    assert scene.drive(0.3).command == "run"


def test_a_board_that_starts_anew_latches_nothing() -> None:
    scene = Scene().running()
    scene.drive(seconds=2.0)
    scene.tick(50)
    scene.distance = scene.heading = 0.0
    scene.tick()
    scene.epoch += 1
    assert scene.tick(50).command == "stop"
    assert "uncommanded_motion" not in scene.state.latches


def test_the_rebound_of_a_contact_and_the_end_of_a_release_latch_nothing_more() -> None:
    scene = hit()
    scene.linear = -0.05
    scene.tick(10)
    scene.linear = 0.0
    scene.tick(40)
    scene.linear = None
    for _ in range(10):
        scene.tick()
        scene.hold()
    scene.tick(100)
    assert set(scene.state.latches) == {"contact", "no_request"}


@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan])
def test_counters_that_are_not_finite_are_ignored(value: float) -> None:
    scene = Scene().running(0.3)
    mileage = scene.inputs.mileage
    assert mileage is not None
    broken = replace(mileage.value, heading=value, distance=value)
    scene.inputs = replace(scene.inputs, mileage=replace(mileage, value=broken))
    assert scene.decide(None).command == "run"


def creeps(scene: Scene, ticks: int = 10) -> None:
    """Let the counters creep while the velocity says standstill."""
    scene.linear = scene.angular = 0.0
    for _ in range(ticks):
        scene.distance += 0.01
        scene.tick()


@pytest.mark.parametrize("interrupted", [False, True])
def test_a_creep_that_only_the_counters_show_latches(interrupted: bool) -> None:
    scene = Scene().ready()
    creeps(scene, 0)
    scene.tick(50)
    if interrupted:
        at, scene.distance = scene.distance, math.nan
        scene.tick()
        scene.distance = at
        scene.tick(2)
    assert "uncommanded_motion" not in scene.state.latches
    creeps(scene)
    assert "uncommanded_motion" in scene.state.latches


def test_decisions_are_numbered() -> None:
    scene = Scene()
    first = scene.state.decision
    scene.decide()
    assert scene.state.decision == first + 1
