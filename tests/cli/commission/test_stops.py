"""Stops in recorded messages: found, measured, or left out with the reason."""

import pytest
from msgspec.structs import replace

from cli.commission.stops import Streams, find_stops
from common.freshness import NS_PER_S
from common.messages import Message, Mileage, Motion, Velocity
from common.motion import Command
from tests.cli.commission.stops_fixture import (
    RUN,
    StopMaker,
    at,
    changed,
    left,
    speed_at,
    streams,
)


@pytest.mark.parametrize(("sign", "direction"), [(1, "forward"), (-1, "backward")])
def test_a_stop_is_measured(sign: int, direction: str) -> None:
    (stop,), left_out = find_stops(streams(sign=sign), "a.mcap")
    assert not left_out
    assert (stop.kind, stop.direction, stop.file) == ("stop", direction, "a.mcap")
    assert stop.speed == 0.8
    assert stop.command == (6, 10 * NS_PER_S)
    assert stop.reaction == pytest.approx(0.1, abs=0.002)
    assert stop.deceleration == pytest.approx(0.5, abs=0.002)
    assert stop.distance == pytest.approx(0.8 * 0.1 + 0.64, abs=0.008)


def test_the_distance_begins_between_two_counters() -> None:
    made = Streams()
    made.add(at(RUN, -0.02))
    made.add(at(Motion(command=Command.STOP), 0.0))
    for number in range(-15, 8):
        now = number * 0.02 + 0.01
        made.add(at(Velocity(linear=0.8 if now < 0.05 else 0.0, angular=0.0), now))
    for now, distance in ((-0.03, 1.0), (0.01, 1.032), (0.05, 1.064), (0.09, 1.1), (0.13, 1.2)):
        made.add(at(Mileage(distance=distance, heading=0.0, epoch=0), now))
    (stop,), _ = find_stops(made)
    assert stop.distance == pytest.approx(1.1 - 1.024)
    assert stop.reaction == pytest.approx(0.03)
    assert stop.deceleration == pytest.approx(0.8 / 0.02)


@pytest.mark.parametrize("command", [Command.STOP, Command.BRAKE])
def test_the_simulators_stops(command: Command) -> None:
    """BRAKE stops the simulated vehicle within a period: its deceleration is a lower bound."""
    maker = StopMaker(delay=0.1, jitter=0.0, coast=0.7)
    for speed in (0.3, -0.8):
        maker.stop(speed, command)
    found, left_out = find_stops(maker.streams)
    assert not left_out
    assert [stop.kind for stop in found] == [command] * 2
    assert [stop.direction for stop in found] == ["forward", "backward"]
    for stop in found:
        assert 0.08 <= stop.reaction <= 0.131
        slow = stop.speed / 0.02 if command is Command.BRAKE else 0.7
        assert stop.deceleration == pytest.approx(slow, rel=0.03)
        braked = stop.speed**2 / 1.4 if command is Command.STOP else 0.0
        assert stop.distance == pytest.approx(braked + stop.speed * stop.reaction, abs=0.012)


def commanding(command: Command, seconds: float, linear: float = 0.0) -> Message:
    return at(Motion(command=command, linear=linear), seconds)


def test_a_command_before_standstill_ends_the_stop() -> None:
    for linear in (0.5, 0.0):
        made = streams(commanding(Command.RUN, 1.0, linear))
        assert left(made) == "changed to RUN before standstill"
    stands_s = 1.685  # the second velocity below 0.02 m/s
    assert speed_at(stands_s - 0.02) < 0.02 < speed_at(stands_s - 0.04)
    assert "changed to RUN" in left(streams(commanding(Command.RUN, stands_s)))
    found, _ = find_stops(streams(commanding(Command.RUN, stands_s + 0.001, 0.5)))
    assert len(found) == 1
    found, _ = find_stops(streams(commanding(Command.STOP, 0.5)))
    assert len(found) == 1


@pytest.mark.parametrize(("brake_s", "braked"), [(1.0, True), (1.685, True), (1.686, False)])
def test_brake_after_stop(brake_s: float, braked: bool) -> None:
    """The vehicle stops at once from then on; the deceleration is that of STOP."""
    made = streams(commanding(Command.BRAKE, brake_s))
    made = changed(made, lambda v, now: replace(v, linear=0.0) if now > brake_s else v)
    (stop,), _ = find_stops(made)
    assert (stop.kind, stop.braked) == ("stop", braked)
    assert stop.reaction == pytest.approx(0.1, abs=0.002)
    assert stop.deceleration == pytest.approx(0.5, abs=0.002)


def test_brake_after_stop_before_it_slowed_down() -> None:
    """0.72 m/s is 90 % of the speed, reached after 0.26 s: three velocities at 0.305 s."""
    for brake_s in (0.1, 0.3):
        made = streams(commanding(Command.BRAKE, brake_s))
        assert left(made) == "changed to BRAKE before it slowed down"
    (stop,), _ = find_stops(streams(commanding(Command.BRAKE, 0.305)))
    assert stop.deceleration == pytest.approx(0.5, abs=0.03)


def test_stop_after_brake_is_left_out() -> None:
    made = streams(commanding(Command.STOP, 1.0))
    made.motions[1] = replace(made.motions[1], command=Command.BRAKE)
    assert left(made) == "changed to STOP before standstill"
    made.motions[2] = replace(made.motions[2], command=Command.BRAKE)
    (stop,), _ = find_stops(made)
    assert (stop.kind, stop.braked) == ("brake", False)


def test_a_slow_stop_is_left_out() -> None:
    assert left(streams(speed=0.099)) == "slower than 0.1 m/s"
    found, _ = find_stops(streams(speed=0.1))
    assert len(found) == 1


def test_a_turning_vehicle_is_left_out() -> None:
    def turned(rate: float) -> Streams:
        return changed(streams(), lambda v, now: replace(v, angular=rate if now < 0.01 else 0.0))

    assert left(turned(0.11)) == "turning"
    assert left(turned(-0.11)) == "turning"
    assert len(find_stops(turned(0.1))[0]) == 1


@pytest.mark.parametrize(
    ("off", "seconds", "steady"),
    [(0.041, -0.19, True), (0.043, -0.19, False), (-0.041, -0.19, False), (0.1, -0.22, True)],
)
def test_an_accelerating_vehicle_is_left_out(off: float, seconds: float, steady: bool) -> None:
    """5 % of the faster velocity, in the 0.2 s before the newest one at the command."""

    def before(v: Velocity, now: float) -> Velocity:
        return replace(v, linear=0.8 + off) if now < seconds else v

    made = changed(streams(), before)
    assert (len(find_stops(made)[0]) == 1) is steady
    if not steady:
        assert left(made) == "not at a steady speed"


def test_a_slow_vehicle_may_scatter_by_3_cm_a_second() -> None:
    def before(off: float) -> Streams:
        made = streams(speed=0.2)
        return changed(made, lambda v, now: replace(v, linear=0.2 + off) if now < -0.1 else v)

    assert len(find_stops(before(0.029))[0]) == 1
    assert left(before(0.031)) == "not at a steady speed"
