"""Stops in recorded messages: found, measured, or left out with the reason; slopes; recordings."""

import math
from collections import Counter
from collections.abc import Callable, Sequence

import pytest
from msgspec.structs import replace

from cli.fit.stops import DRIVING, TURNING, find_stops, slope
from cli.fit.stops import counted as counted_text
from cli.fit.streams import Streams
from common.freshness import NS_PER_S
from common.motion import Twist
from t2.messages import Bumper, Command, Health, Message, Mileage, Motion, Velocity
from tests.cli.fit.stops_fixture import AT_NS, at, changed, speed_at, streams


@pytest.mark.parametrize(
    ("turns", "sign", "direction"),
    [
        (False, 1, "forward"),
        (False, -1, "backward"),
        (True, 1, "left"),  # across the end of the heading's range
        (True, -1, "right"),
    ],
)
def test_a_stop_is_measured(turns: bool, sign: int, direction: str) -> None:
    (stop,), left_out = find_stops(streams(sign=sign, turns=turns))
    assert not left_out
    assert stop.axis is (TURNING if turns else DRIVING)
    assert (stop.kind, stop.direction, stop.at_ns) == ("stop", direction, AT_NS)
    assert stop.speed == pytest.approx(0.8)
    assert stop.twist.linear == pytest.approx(0.0 if turns else sign * 0.8)
    assert stop.twist.angular == pytest.approx(sign * 0.8 if turns else 0.0)
    assert len(stop.points) == (83 if turns else 86)
    assert stop.reaction == pytest.approx(0.1, abs=0.002)
    assert stop.deceleration == pytest.approx(0.5, abs=0.002)
    assert stop.distance == pytest.approx(0.8 * 0.1 + 0.64, abs=0.008)


def test_a_stop_in_a_curve_is_one_of_each_axis() -> None:
    made = changed(streams(), lambda v, now: replace(v, angular=v.linear / 2))
    made.mileages = [replace(m, heading=(m.distance - 7) / 2) for m in made.mileages]
    driving, turning = find_stops(made)[0]
    assert (driving.axis, turning.axis) == (DRIVING, TURNING)
    assert driving.twist == turning.twist == Twist(0.8, 0.4)
    assert driving.deceleration == pytest.approx(2 * turning.deceleration, abs=0.004)
    assert driving.distance == pytest.approx(2 * turning.distance)


def test_the_distance_begins_between_two_counters() -> None:
    made = Streams()
    made.add(at(Motion(command=Command.RUN, linear=0.8), -0.02))
    made.add(at(Motion(command=Command.STOP, seq=1), 0.0))
    for number in range(-15, 8):
        now = number * 0.02 + 0.01
        made.add(at(Velocity(linear=0.8 if now < 0.05 else 0.0, angular=0.0), now))
    for now, distance in ((-0.03, 1.0), (0.01, 1.032), (0.05, 1.066), (0.09, 1.1), (0.13, 1.2)):
        made.add(at(Mileage(distance=distance, heading=0.0, epoch=0), now))
    (stop,), _ = find_stops(made)
    assert stop.distance == pytest.approx(1.1 - 1.024)
    assert stop.reaction == pytest.approx(0.03)
    assert stop.deceleration == pytest.approx(0.8 / 0.02)


def commanding(command: Command, seconds: float, linear: float = 0.0) -> Message:
    return at(Motion(command=command, linear=linear), seconds)


@pytest.mark.parametrize(("brake_s", "braked"), [(1.0, True), (1.685, True), (1.686, False)])
def test_brake_after_stop(brake_s: float, braked: bool) -> None:
    """The vehicle stops at once from then on; the deceleration is that of STOP."""
    made = streams(commanding(Command.BRAKE, brake_s))
    made = changed(made, lambda v, now: replace(v, linear=0.0) if now > brake_s else v)
    (stop,), _ = find_stops(made)
    assert (stop.kind, stop.braked) == ("stop", braked)
    assert stop.reaction == pytest.approx(0.1, abs=0.002)
    assert stop.deceleration == pytest.approx(0.5, abs=0.002)


def test_the_velocity_at_the_begin_of_brake_belongs_to_the_slope_of_stop() -> None:
    made = streams(commanding(Command.BRAKE, 0.145))
    made = changed(made, lambda v, now: replace(v, linear=0.8 if now < 0.13 else 0.0))
    (stop,), _ = find_stops(made)
    assert stop.braked
    assert stop.deceleration == pytest.approx(0.8 / 0.02)


def test_a_stop_by_brake() -> None:
    (stop,), _ = find_stops(braking())
    assert (stop.kind, stop.braked) == ("brake", False)


def test_the_speed_is_the_mean_before_the_command() -> None:
    (stop,), _ = find_stops(faster(0.01, 0.0))
    assert stop.speed == pytest.approx(0.81)
    (stop,), _ = find_stops(faster(0.022, -0.2))  # one of eleven
    assert stop.speed == pytest.approx(0.802)


def test_a_single_velocity_of_zero_is_no_standstill() -> None:
    glitch = changed(streams(), lambda v, now: replace(v, linear=0.0) if 0.5 < now < 0.52 else v)
    (stop,), _ = find_stops(glitch)
    assert stop.distance > 0.7


def test_all_stops_of_a_recording_are_found() -> None:
    made, second = streams(), streams(sign=-1, begin_s=20.0)
    made.motions += second.motions
    made.velocities += second.velocities
    made.mileages += second.mileages
    assert [stop.direction for stop in find_stops(made)[0]] == ["forward", "backward"]


def test_a_vehicle_may_stand_from_the_first_velocity_after_the_command_on() -> None:
    made = changed(streams(), lambda v, now: replace(v, linear=0.0) if now > 0 else v)
    (stop,), _ = find_stops(made)
    assert stop.speed == pytest.approx(0.8)


def test_turning_slower_than_standstill_is_not_on_the_slope() -> None:
    made = changed(
        streams(speed=0.2, turns=True),
        lambda v, now: replace(v, angular=0.021) if v.angular < 0.05 else v,
    )
    (stop,), _ = find_stops(made)
    assert stop.deceleration == pytest.approx(0.5, abs=0.002)


# --- left out -----------------------------------------------------------------------------------


def braking(*then: Command) -> Streams:
    """Return a BRAKE at 0 s, and further commands at 1 s."""
    return streams(*(commanding(each, 1.0) for each in then), command=Command.BRAKE)


def moving(change: Callable[[Velocity, float], Velocity | None], speed: float = 0.8) -> Streams:
    return changed(streams(speed=speed), change)


def only(keep: Callable[[float], bool]) -> Streams:
    """Return a stop with the velocities of these times."""
    return moving(lambda v, now: v if keep(now) else None)


def faster(by: float, until_s: float, speed: float = 0.8) -> Streams:
    return moving(lambda v, now: replace(v, linear=speed + by) if now < until_s else v, speed)


def turned(rate: float, since_s: float = -1.0, until_s: float = 0.01) -> Streams:
    return moving(lambda v, now: replace(v, angular=rate * (since_s < now < until_s)))


def counted(keep: Callable[[float], bool]) -> Streams:
    made = streams()
    made.mileages = [m for m in made.mileages if keep(m.mono_ns / NS_PER_S - 10)]
    return made


def restarted(first: int, **change: int) -> Streams:
    made = streams()
    made.mileages[first:] = [replace(m, **change) for m in made.mileages[first:]]
    return made


STANDS_S = 1.685  # the second velocity below 0.02 m/s
RUN_FIRST, STOP_FIRST = (f"changed to {name} before standstill" for name in ("RUN", "STOP"))
SPEEDS, COUNTERS = "velocities are missing", "counters are missing"
ENDS, UNSTEADY = "the recording ends before standstill", "not at a steady speed"
SLOW = "slower than 0.1 m/s and 0.2 rad/s"
HIT, RESTART = "the bumper was pressed", "bridge or board restarted"


@pytest.mark.parametrize(
    ("made", "reason"),
    [
        (streams(commanding(Command.RUN, 1.0, 0.5)), RUN_FIRST),
        (streams(commanding(Command.RUN, STANDS_S)), RUN_FIRST),
        (streams(commanding(Command.RUN, STANDS_S + 0.001, 0.5)), ""),
        (streams(commanding(Command.STOP, 0.5)), ""),
        (braking(Command.STOP), STOP_FIRST),
        (braking(Command.BRAKE), ""),
        (streams(speed=0.099), SLOW),
        (streams(speed=0.1), ""),
        (turned(0.19), ""),  # as straight
        (turned(0.5, -0.105), UNSTEADY),
        (streams(speed=0.199, turns=True), SLOW),
        # 5 % of the faster velocity, between the halves of the 0.2 s, which share the middle one
        (faster(0.050, -0.1), ""),
        (faster(0.052, -0.1), UNSTEADY),
        (faster(0.1, -0.2), ""),  # a single velocity
        (faster(0.1, -0.22), ""),
        (faster(0.035, -0.1, 0.2), ""),  # a slow vehicle may scatter by 3 cm/s
        (faster(0.037, -0.1, 0.2), UNSTEADY),
        (only(lambda now: now > 0), SPEEDS),
        (only(lambda now: now > -0.02), ""),
        (only(lambda now: now > 0 or now < -0.1), SPEEDS),
        (only(lambda now: not 0.5 < now < 0.6), SPEEDS),
        (only(lambda now: not 0.5 < now < 0.58), ""),
        (streams(until_s=1.5), ENDS),
        (turned(0.2, 1.0, 9.0), ENDS),  # it does not stand while it turns
        (counted(lambda now: now > 0), COUNTERS),
        (counted(lambda now: now < 1.69), COUNTERS),
        (counted(lambda now: not -0.1 < now < 0.15), COUNTERS),
        (counted(lambda now: not 1.7 < now < 1.9), COUNTERS),
        (counted(lambda now: not -0.1 < now < 0.05), ""),
        (counted(lambda now: not 1.7 < now < 1.88), ""),
        (restarted(33, epoch=1), RESTART),
        (restarted(33, boot=4), RESTART),
        (restarted(3, boot=4), ""),
    ],
)
def test_stops_that_are_left_out(made: Streams, reason: str) -> None:
    assert speed_at(STANDS_S - 0.02) < 0.02 < speed_at(STANDS_S - 0.04)
    found, left_out = find_stops(made)
    assert left_out == ({reason: 1} if reason else {})
    assert len(found) == (not reason)
    assert not any(stop.braked for stop in found)


@pytest.mark.parametrize(
    ("seconds", "pressed", "reasons"),
    [(0.0, True, {HIT: 1}), (STANDS_S, True, {HIT: 1}), (1.69, True, {}), (0.5, False, {})],
)
def test_a_pressed_bumper(seconds: float, pressed: bool, reasons: dict[str, int]) -> None:
    assert find_stops(streams(at(Bumper(pressed=pressed), seconds)))[1] == reasons


def test_stops_that_are_left_out_are_counted() -> None:
    made = streams(speed=0.05)
    made.motions *= 2
    assert find_stops(made) == ([], {SLOW: 2})


def test_reasons_as_text() -> None:
    assert counted_text(Counter(slow=1, late=3)) == "3 late, 1 slow"


def test_a_vehicle_that_turns_in_place_has_speed() -> None:
    made = streams(speed=0.0)
    made.motions[0] = replace(made.motions[0], angular=0.5)
    assert find_stops(made) == ([], {SLOW: 1})


def test_what_begins_a_stop() -> None:
    """Only the first STOP or BRAKE after a RUN with speed."""
    made = streams()
    made.motions = [
        Motion(command=Command.STOP),
        Motion(command=Command.RUN, linear=0.0004),
        Motion(command=Command.STOP),
        Motion(command=Command.STOP),
        Motion(command=Command.RUN, linear=0.5),
        Motion(command=Command.RUN, linear=0.5),
    ]
    assert find_stops(made) == ([], {})


def test_a_vehicle_that_brake_had_to_stop_did_not_slow_down_steadily() -> None:
    made = streams(commanding(Command.BRAKE, 0.3), deceleration=0.02, until_s=3.0)
    made = changed(made, lambda v, now: replace(v, linear=0.0) if now > 1.0 else v)
    (stop,), left_out = find_stops(made)
    assert not left_out
    assert (stop.is_steady, stop.braked) == (False, True)
    assert stop.distance > 0.7


@pytest.mark.parametrize(
    ("change", "whole"),
    [
        ({}, True),
        ({"seq": 3}, False),
        ({"boot": 7}, False),
        ({"mono_ns": 10 * NS_PER_S + 80_000_000}, True),
        ({"mono_ns": 10 * NS_PER_S + 80_000_001}, False),
    ],
)
def test_a_command_whose_begin_may_be_missing(change: dict[str, int], whole: bool) -> None:
    made = streams()
    made.motions[1] = replace(made.motions[1], **change)
    (stop,), _ = find_stops(made)
    assert stop.is_whole is whole


def test_velocities_against_the_counters_show_nothing() -> None:
    made = streams()
    made.mileages = [replace(m, distance=14 - m.distance) for m in made.mileages]
    assert find_stops(made) == ([], {"velocity and counters have opposite signs": 1})


@pytest.mark.parametrize(("before_s", "commanded"), [(0.2, 0.9), (0.201, 0.5)])
def test_a_vehicle_that_was_being_slowed_down_obeyed(before_s: float, commanded: float) -> None:
    """Safety commands less from one motion to the next: the speed is of the 0.2 s before."""
    made = streams()
    made.motions[0] = replace(made.motions[0], linear=0.5)
    earlier = Motion(command=Command.RUN, linear=0.9, boot=6)
    made.motions.insert(0, at(earlier, -before_s))  # type: ignore[arg-type]
    (stop,), _ = find_stops(made)
    assert stop.commanded == pytest.approx(commanded)


def test_counters_that_stand_are_no_contradiction() -> None:
    made = streams()
    made.mileages = [replace(m, distance=7.0) for m in made.mileages]
    (stop,), _ = find_stops(made)
    assert stop.distance == 0.0


def test_what_was_commanded_and_integrated() -> None:
    (stop,), _ = find_stops(streams(sign=-1))
    assert stop.commanded == pytest.approx(0.8)
    (turn,), _ = find_stops(streams(sign=-1, turns=True))
    assert turn.commanded == pytest.approx(0.8)
    assert stop.integrated == pytest.approx(stop.distance, abs=0.01)
    assert not stop.is_curve


def test_no_velocity_above_the_slope() -> None:
    """All of them are below 90 % of the mean speed before."""
    assert slope([(0.0, 0.8), (0.1, 0.6), (0.2, 0.4), (0.3, 0.2), (0.4, 0.0)], 1.0)[1] == 2.0


@pytest.mark.parametrize("speeds", [(0.2, 0.5, 0.8), (0.5, 0.52, 0.54), (0.5, 0.5, 0.5)])
def test_a_rate_that_is_not_falling(speeds: Sequence[float]) -> None:
    points = [(number / 10, speed) for number, speed in enumerate((1.0, *speeds, 0.0))]
    assert all(map(math.isnan, slope(points, 1.0)))


@pytest.mark.parametrize(
    ("speeds", "reaction", "deceleration"),
    [
        ((1.0, 0.8, 0.4, 0.2, 0.0), 0.0222222, 3.0),  # a line through three velocities
        ((2.0, 1.6, 1.0, 0.4, 0.1, 0.0), 0.0333333, 6.0),
        ((0.15, 0.1, 0.05, 0.02, 0.019), -0.0333333, 0.4),  # 0.019 m/s is standstill
        ((1.0, 1.0, 0.6, 0.3, 0.0), 0.1, 1 / 0.3),  # two: between 1.0 and 0.0
        ((1.0, 0.95, 0.9, 0.5, 0.1, 0.05), 0.175, 4.0),  # 0.9 and 0.1 belong to the slope
        ((1.0, 0.5, 1.0, 0.8, 0.5, 0.2, 0.0), 0.2333333, 3.0),  # from the last full speed
    ],
)
def test_the_slope(speeds: Sequence[float], reaction: float, deceleration: float) -> None:
    points = [(number / 10, speed) for number, speed in enumerate(speeds)]
    assert slope(points, speeds[0]) == pytest.approx((reaction, deceleration), rel=1e-5)


def test_problems_of_a_recording() -> None:
    assert not streams().problem
    made = Streams()
    assert made.period_s == 0.0
    made.add(Health(service="x", version="", uptime=0, rates={}, counters={}, lateness=0, rss=0))
    assert made.problem == (
        "has no @cmd/motion and no tel/bridge/velocity and no tel/bridge/mileage: "
        "record all keys with `t2 record`"
    )
    coarse = streams()
    coarse.velocities = coarse.velocities[::5]
    assert coarse.problem.startswith("has a velocity each 0.10 s, too coarse for a stop")
