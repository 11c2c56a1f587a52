"""The judge sees what it should, and objects to a stack that has a protection taken out."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from msgspec.structs import replace as with_fields

from common import keys
from common import messages as m
from services.bridge import lease as leases
from services.bridge import link as links
from services.bridge.lease import Lease, Order
from services.bridge.readiness import Readiness
from services.safety import latches
from services.safety.arbiter import Arbiter
from services.safety.zones import Zones
from tests.invariants.net import Weather
from tests.invariants.stack import Stack


def driving(linear: float = 0.5) -> Stack:
    """Return a stack that drives as teleop asks."""
    stack = Stack()
    stack.run(700)
    stack.sticks["teleop"].asks = (0.0, 0.0)
    stack.run(700)
    stack.sticks["teleop"].asks = (linear, 0.0)
    stack.run(1500)
    assert stack.vehicle.twist.linear == pytest.approx(linear, abs=0.05)
    return stack


def test_a_drive_is_seen_and_found_good() -> None:
    stack = driving()
    assert stack.judge.runs > 50
    assert stack.judge.violations == []


def test_a_hit_stops_and_only_reset_and_neutral_let_it_drive_again() -> None:
    stack = driving()
    stack.vehicle.pressed = True
    stack.run(300)
    stack.vehicle.pressed = False
    runs = stack.judge.runs
    stack.run(3000)
    assert (stack.judge.runs, stack.vehicle.twist.linear) == (runs, 0.0)
    stack.sticks["teleop"].asks = (0.0, 0.0)
    stack.run(600)
    assert stack.reset()
    stack.run(200)
    stack.sticks["teleop"].asks = (0.5, 0.0)
    stack.run(500)
    assert stack.judge.runs > runs
    assert stack.judge.violations == []


@pytest.mark.parametrize("name", ["safety", "bridge", "board", "router"])
def test_what_came_back_drives_after_a_neutral_request_and_not_before(name: str) -> None:
    stack = driving()
    if name == "board":
        stack.power_cycle(500)
    elif name == "router":
        stack.router(up=False)
        stack.run(500)
        stack.router(up=True)
    else:
        stack.kill(name, 300)
    stack.run(500)
    runs = stack.judge.runs
    stack.run(1500)
    assert stack.judge.runs == runs
    stack.sticks["teleop"].asks = (0.0, 0.0)
    stack.run(700)
    assert stack.reset()
    stack.run(700)
    stack.sticks["teleop"].asks = (0.5, 0.0)
    stack.run(500)
    assert stack.judge.runs > runs
    assert stack.judge.violations == []


def safety_dies(stack: Stack) -> None:
    stack.kill("safety", 5000)


def estop(stack: Stack) -> None:
    stack.estop()
    stack.run(700)
    stack.sticks["teleop"].asks = (0.0, 0.0)
    stack.run(700)
    stack.sticks["teleop"].asks = (0.5, 0.0)


def board_freezes(stack: Stack) -> None:
    stack.vehicle.freeze(400)


def wall(stack: Stack) -> None:
    stack.vehicle.ranges[2] = 250


def hit_while_a_run_is_under_way(stack: Stack) -> None:
    stack.net.weather["motion"] = Weather(late_ms=60)
    stack.run(300)
    stack.vehicle.pressed = True


def motions_get_lost(stack: Stack) -> None:
    """Let the bridge's lease end without safety hearing of it in time."""
    stack.net.weather.update(streams=Weather(late_ms=120), motion=Weather(lose=1))
    stack.run(250)
    stack.net.weather.pop("motion")


def board_freezes_and_safety_hears_late(stack: Stack) -> None:
    """Let the board be back before safety has missed its samples."""
    stack.net.weather["streams"] = Weather(late_ms=120)
    stack.run(300)
    stack.vehicle.freeze(240)


def brakes_go_off_and_on(stack: Stack) -> None:
    """Let safety hear too late that the board's brake was off."""
    stack.net.weather["streams"] = Weather(late_ms=120)
    stack.run(300)
    for on, ms in ((False, 60), (True, 60)):
        with stack.time():
            stack.bridge.call(keys.SET_SWITCHES, m.SwitchesRequest(bumper_brake=on))
        stack.run(ms)


def still_armed(lease: Lease, ready: bool) -> Lease:
    return replace(lease, ready=ready)


def safety_dies_latched(stack: Stack) -> None:
    stack.estop()
    stack.kill("safety", 20)
    stack.run(1500)
    stack.sticks["teleop"].asks = (0.0, 0.0)
    stack.run(700)
    stack.sticks["teleop"].asks = (0.5, 0.0)


def untold(lease: Lease, motion: m.Motion, *rest: Any) -> Any:
    return ON_MOTION(lease, with_fields(motion, latched=False), *rest)


def still_neutral(lease: Lease, now_ns: int, lease_ns: int) -> Lease:
    return replace(EXPIRE(lease, now_ns, lease_ns), neutral=lease.neutral)


def unjudged(lease: Lease, seq: int, now_ns: int) -> tuple[Lease, Order]:
    return replace(lease, sent_ns=now_ns), Order.BRAKE


def stop_instead(lease: Lease, seq: int, now_ns: int) -> tuple[Lease, Order]:
    return replace(lease, hit=seq, sent_ns=now_ns), Order.STOP


EXPIRE, ON_MOTION = leases.expire, leases.on_motion

BREAKAGES: dict[str, tuple[object, str, object, Callable[[Stack], None], str]] = {
    "the bridge's lease never ends": (
        leases, "expire", lambda lease, *_: lease, safety_dies, "a RUN is held",
    ),
    "latches clear by time": (
        latches, "_is_over", lambda *_: True, estop, "safety knows of estop",
    ),
    "no neutral after a return": (
        Arbiter, "disarmed", lambda self: self, board_freezes, "was not neutral",
    ),
    "no neutral after a lease": (
        leases, "expire", still_neutral, motions_get_lost, "no neutral motion came",
    ),
    "silence is not noticed": (
        links, "on_tick", lambda link, *_: link, board_freezes_and_safety_hears_late,
        "the board is silent",
    ),
    "brakes that are off": (
        Readiness, "ready", property(lambda self: self.link.state == "up"), brakes_go_off_and_on,
        "its brakes are not both on",
    ),
    "no neutral after brakes that were off": (
        leases, "on_ready", still_armed, brakes_go_off_and_on, "no neutral motion came",
    ),
    "the bridge remembers no latch": (
        leases, "on_motion", untold, safety_dies_latched, "bridge knows of estop",
    ),
    "the margin is ignored": (
        Zones, "allowed", lambda *_: 1.0, wall, "toward sonar 2",
    ),
    "a hit needs no judgement": (
        leases, "on_hit", unjudged, hit_while_a_run_is_under_way, "bridge knows of contact",
    ),
    "the reflex does not brake": (
        leases, "on_hit", stop_instead, hit_while_a_run_is_under_way, "without a BREAK",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BREAKAGES)
def test_a_protection_that_is_missing_is_objected_to(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    owner, attribute, broken, scenario, objection = BREAKAGES[name]
    monkeypatch.setattr(owner, attribute, broken)
    stack = driving()
    assert stack.judge.violations == []
    scenario(stack)
    stack.run(2000)
    assert any(objection in one for one in stack.judge.violations), stack.judge.violations[:5]


@pytest.mark.parametrize("name", BREAKAGES)
def test_the_same_scenario_is_harmless_as_shipped(name: str) -> None:
    stack = driving()
    BREAKAGES[name][3](stack)
    stack.run(2000)
    assert stack.judge.violations == []
