"""The independent vehicle, sonars and cable, each weakness by its figures."""

import math

import pytest

from verification.outside.board import Faults
from verification.outside.cable import Cable, Packing, Port
from verification.outside.sonars import NO_ECHO_MM, Ring, before
from verification.outside.vehicle import TRACK, Motors, Vehicle
from verification.outside.wire import Command, Kind

STEP = 0.005
CLEAR = [4000] * 8


def ride(vehicle: Vehicle, seconds: float, kind: Kind, linear: float = 0.0) -> Vehicle:
    command = Command(0.0, kind, linear, 0.0)
    for _ in range(round(seconds / STEP)):
        vehicle.follow(command, Faults(), STEP)
    return vehicle


def test_an_ideal_vehicle_reaches_its_command_and_stops() -> None:
    vehicle = ride(Vehicle(), 1.0, "run", 0.4)
    assert (vehicle.linear, vehicle.angular) == (0.4, 0.0)
    assert ride(vehicle, 0.6, "stop").linear == 0.0


def test_dead_time_holds_every_command_back() -> None:
    vehicle = Vehicle(motors=Motors(dead_time=0.1))
    assert ride(vehicle, 0.095, "run", 0.4).linear == 0.0
    assert ride(vehicle, 1.0, "run", 0.4).linear == 0.4
    assert ride(vehicle, 0.095, "brake").linear == 0.4
    assert ride(vehicle, 0.5, "brake").linear == 0.0


def test_a_lag_makes_the_way_to_stop_longer() -> None:
    ways = []
    for lag in (0.0, 0.3):
        vehicle = ride(Vehicle(motors=Motors(lag=lag)), 4.0, "run", 0.4)
        begin = vehicle.distance
        ways.append(ride(vehicle, 4.0, "stop").distance - begin)
    assert ways[0] == pytest.approx(0.1, abs=0.01)
    assert ways[1] == pytest.approx((0.16 - 0.24**2) / 1.6 + 0.24 * 0.3, abs=0.01)


def test_unlike_sides_turn_and_slow_sides_stand() -> None:
    assert ride(Vehicle(motors=Motors(dead_zone=0.06)), 1.0, "run", 0.05).linear == 0.0
    vehicle = ride(Vehicle(motors=Motors(left=0.9)), 2.0, "run", 0.4)
    assert vehicle.linear == pytest.approx(0.38, abs=0.003)
    assert vehicle.angular == pytest.approx(0.04 / TRACK, abs=0.003)


def test_a_slope_rolls_after_stop_only() -> None:
    vehicle = Vehicle(motors=Motors(slope=math.radians(2)))
    assert ride(vehicle, 1.0, "run").linear == 0.0
    assert ride(vehicle, 1.0, "stop").linear == pytest.approx(0.342, abs=0.01)
    assert ride(vehicle, 0.5, "brake").linear == 0.0


def test_a_collision_rebounds() -> None:
    vehicle = ride(Vehicle(motors=Motors(rebound=0.5)), 1.0, "run", 0.4)
    vehicle.collide(0.2)
    assert (vehicle.distance, vehicle.linear) == (0.2, -0.2)


def test_sonars_report_the_truth_unless_told_otherwise() -> None:
    assert Ring().report(before(CLEAR, 1.0)) == [4000, 1414, 1000, 1414, *CLEAR[4:]]
    assert Ring(resolution_mm=10, longest_mm=3000).report([1239, *CLEAR[1:]])[:2] == [1230, 3000]
    assert Ring(floor=1.0, floor_mm=600).report(CLEAR) == [600] * 8
    assert Ring(crossed=1.0).report([500, 500, 4000, 500, *CLEAR[4:]])[2] == 500


def test_absorbed_echoes_stay_away_for_their_readings() -> None:
    ring = Ring(absorbed=0.05, absorbed_readings=4)
    lost = [ring.report(CLEAR)[0] == NO_ECHO_MM for _ in range(4000)]
    runs = [len(run) for run in "".join(".x"[each] for each in lost).strip("x").split(".") if run]
    assert len(runs) > 50
    assert all(run % 4 == 0 for run in runs)


def test_the_cable_loses_doubles_and_delays_by_port() -> None:
    cable, bad = Cable(), Port(lost=0.5, doubled=0.5)
    for _ in range(2000):
        cable.put(b"a", 0, bad, 0.0)
        cable.put(b"b", 1, Port(delay=0.1, jitter=0.1), 0.0)
    assert len(cable.take(0.0)) == pytest.approx(1500, abs=150)
    assert len(cable.take(0.15)) == pytest.approx(1000, abs=150)
    assert len(cable.take(0.2)) == pytest.approx(1000, abs=150)


def test_frames_are_split_or_merged() -> None:
    first, second = Packing(split=1.0).pack(b"abcd", 0)
    assert first + second == b"abcd"
    packing = Packing(merge=0.02)
    packing.collected(1.0)
    assert [packing.pack(frame, 0) for frame in (b"ab", b"cd")] == [[], []]
    assert packing.collected(1.0) == [(b"abcd", 0)]
    packing.pack(b"ef", 1)
    assert packing.collected(1.01) == []
    assert packing.collected(1.02) == [(b"ef", 1)]
