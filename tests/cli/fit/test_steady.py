"""Scales, delays, biases and noise of synthetic drives."""

import math

import pytest
from msgspec.structs import replace

from cli.fit.estimate import Estimate
from cli.fit.steady import greatest, of_ground_truth, of_ramps, of_standstill, of_steady_motion
from cli.fit.streams import Streams
from common.freshness import NS_PER_S
from t2.messages import Command, Mileage, Motion, Velocity

STEP_S = 0.02


def drive(
    *parts: tuple[float, float, float],
    scale: float = 1.0,
    late: int = 0,
    bias: float = 0.0,
    noise: float = 0.0,
) -> Streams:
    """Return parts of (seconds, m/s, rad/s) that the vehicle follows ``late`` steps later."""
    made, travel, heading = Streams(), 0.0, 3.0
    commands = [part[1:] for part in parts for _ in range(round(part[0] / STEP_S))]
    for number, (linear, angular) in enumerate(commands):
        now_ns = round((10 + number * STEP_S) * NS_PER_S)
        command = Command.RUN if linear or angular else Command.STOP
        made.add(
            Motion(command=command, linear=linear, angular=angular, mono_ns=now_ns, seq=number)
        )
        real = commands[number - late] if number >= late else (0.0, 0.0)
        travel += real[0] * scale * STEP_S
        heading = math.remainder(heading + real[1] * scale * STEP_S, math.tau)
        wobble = noise * (-1) ** number
        made.add(
            Velocity(
                linear=real[0] + bias + wobble, angular=real[1], mono_ns=now_ns + 1, seq=number
            )
        )
        if number % 2:
            made.add(
                Mileage(distance=travel, heading=heading, epoch=0, mono_ns=now_ns + 2, seq=number)
            )
    return made


def by_name(estimates: list[Estimate]) -> dict[str, Estimate]:
    return {each.name: each for each in estimates}


@pytest.mark.parametrize("sign", [1, -1])
def test_ratios_at_steady_speeds(sign: int) -> None:
    made = drive((1.0, 0, 0), (2.0, sign * 0.4, 0), (1.0, 0, 0), (2.0, 0, sign * 0.5), scale=1.1)
    found = by_name(of_steady_motion(made))
    assert found["distance, counted / commanded"].mean == pytest.approx(1.1)
    assert found["speed, measured / counted"].mean == pytest.approx(1 / 1.1)
    assert found["turn, counted / commanded"].mean == pytest.approx(1.1)
    assert found["turning speed, measured / counted"].mean == pytest.approx(1 / 1.1)
    assert found["turn counted on a straight line"].mean == pytest.approx(0.0)
    assert {len(each.values) for each in found.values()} == {1}


@pytest.mark.parametrize(
    "part",
    [
        (0.9, 0.4, 0.0),  # too short
        (2.0, 0.04, 0.0),  # too slow
        (2.0, 0.4, 0.3),  # a curve is neither
    ],
)
def test_what_shows_no_ratio(part: tuple[float, float, float]) -> None:
    assert of_steady_motion(drive((1.0, 0, 0), part)) == []


def test_a_vehicle_that_is_still_speeding_up_shows_no_ratio() -> None:
    made = drive((1.0, 0, 0), (3.0, 0, 0.9))
    made.velocities = [
        replace(v, angular=min(0.9, n / 150 * 0.9)) for n, v in enumerate(made.velocities)
    ]
    assert of_steady_motion(made) == []


def test_counters_of_two_starts_show_no_ratio() -> None:
    made = drive((1.0, 0, 0), (2.0, 0.4, 0))
    made.mileages = [replace(m, epoch=n // 55) for n, m in enumerate(made.mileages)]
    assert of_steady_motion(made) == []


def test_bias_and_noise_at_standstill() -> None:
    found = by_name(
        of_standstill(drive((2.0, 0, 0), (2.0, 0.4, 0), (2.0, 0, 0), bias=0.003, noise=0.004))
    )
    assert found["speed at standstill, bias"].mean == pytest.approx(0.003, abs=1e-4)
    assert found["speed at standstill, noise"].mean == pytest.approx(0.004, rel=0.02)
    assert found["heading counter at standstill"].mean == pytest.approx(0.0)
    assert len(found["speed at standstill, bias"].values) == 2


def test_a_vehicle_that_never_stands_shows_no_bias() -> None:
    assert of_standstill(drive((2.0, 0, 0), bias=0.1)) == []


@pytest.mark.parametrize("late", [0, 5, 10])
def test_the_delay_of_a_commanded_speed(late: int) -> None:
    ramp = [(STEP_S, 0.02 * n, 0.0) for n in range(1, 26)]
    delay, acceleration = of_ramps(drive((1.0, 0, 0), *ramp, (1.0, 0.5, 0), late=late))
    assert (delay.name, acceleration.name) == ("RUN driving: delay", "RUN driving: acceleration")
    assert delay.mean == pytest.approx(late * STEP_S, abs=0.011)
    assert acceleration.mean == pytest.approx(1.0, rel=0.05)


def test_a_small_change_of_speed_shows_no_delay() -> None:
    assert of_ramps(drive((1.0, 0.3, 0), (1.0, 0.4, 0))) == []


def test_a_distance_and_a_turn_that_were_measured_on_the_ground() -> None:
    line = drive((1.0, 0, 0), (2.0, -0.5, 0), (1.0, 0, 0), scale=1.02)
    (distance,) = of_ground_truth([line], 1.0, None)
    assert distance.mean == pytest.approx(1.02, abs=0.03)
    turn = drive((1.0, 0, 0), (2 * math.tau, 0, 1.0), (1.0, 0, 0), scale=0.98)
    (turned,) = of_ground_truth([turn], None, 2.0)
    assert turned.mean == pytest.approx(0.98, abs=0.02)
    line.mileages[9:] = [replace(m, epoch=1) for m in line.mileages[9:]]
    with pytest.raises(ValueError, match="restarted"):
        list(of_ground_truth([line], 1.0, None))


def test_the_greatest_speed_needs_three_velocities() -> None:
    made = drive((1.0, 0.5, 0), (0.04, 0.9, 0), (1.0, 0, 0.7))
    assert (greatest(made).linear, greatest(made).angular) == (0.5, 0.7)
