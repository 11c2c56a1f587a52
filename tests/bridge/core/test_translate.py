"""The board's numbers: frames to SI and back, the bumper, counters that restarted."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import WireError
from common.settings import AngularUnit, Vehicle, Wire
from common.wire.commands import MotionCommand, MotionKind
from common.wire.frame import Side
from common.wire.reports import DistanceReport, DriverReport, UltrasonicReport, VelocityReport
from services.bridge.core.core import BumperFilter
from services.bridge.core.restart_detection import (
    DRIVEN_MPS,
    FAST_MPS,
    FAST_RADPS,
    STEP,
    STEP_TO_ZERO,
    TURNED_RADPS,
    ZERO_M,
    ZERO_RAD,
    restarted,
)
from services.bridge.core.translate import Translator, driver
from t2.messages import Command, Mileage, Motion


@pytest.fixture
def by_manual() -> Translator:
    return Translator(Wire(), Vehicle())


def run(linear: float, angular: float) -> Motion:
    return Motion(command=Command.RUN, linear=linear, angular=angular)


@pytest.mark.parametrize(
    ("motion", "linear_mmps", "angular_raw"),
    [
        (run(0.5, math.radians(30)), 500, 300),
        (run(-0.5, -math.radians(30)), -500, -300),
        (run(0.0, 0.0), 0, 0),
        (run(-0.0, -0.0), 0, 0),
        (run(9.0, 9.0), 1000, 573),
        (run(-9.0, -9.0), -1000, -573),
        (run(2.0, 0.5), 1000, 143),  # on the same curve
        (run(0.5, 2.0), 250, 573),
        (run(0.0004, 0.0), 0, 0),
    ],
)
def test_run_carries_the_motion_slowed_to_the_limits(
    by_manual: Translator, motion: Motion, linear_mmps: int, angular_raw: int
) -> None:
    frame = by_manual.run(motion)
    assert frame == MotionCommand(MotionKind.RUN, linear_mmps, angular_raw)
    assert b"\x00\x80" not in frame.to_bytes()


@pytest.mark.parametrize(
    ("command", "feedback", "raw", "angular"),
    [("milliradian", "decidegree", 300, math.radians(30)), ("decidegree", "milliradian", 172, 0.3)],
)
def test_each_way_has_a_unit_of_its_own(
    command: AngularUnit, feedback: AngularUnit, raw: int, angular: float
) -> None:
    wire = Wire(command_angular_unit=command, feedback_angular_unit=feedback)
    mixed = Translator(wire, Vehicle())
    assert mixed.run(run(0.0, 0.3)).angular_raw == raw
    assert mixed.velocity(VelocityReport(0, 300)).angular == pytest.approx(angular)


@given(st.integers(-5000, 5000), st.integers(-5729, 5729))
def test_velocities_come_back_as_they_went(linear_mmps: int, angular_raw: int) -> None:
    free = Translator(Wire(), Vehicle(max_linear=100.0, max_angular=100.0))
    velocity = free.velocity(VelocityReport(linear_mmps, angular_raw))
    frame = free.run(run(velocity.linear, velocity.angular))
    assert (frame.linear_mmps, frame.angular_raw) == (linear_mmps, angular_raw)


@pytest.mark.parametrize(
    "frame", [VelocityReport(5001, 0), VelocityReport(-5001, 0), VelocityReport(0, 5730)]
)
def test_a_velocity_that_no_vehicle_has_is_refused(
    by_manual: Translator, frame: VelocityReport
) -> None:
    with pytest.raises(WireError, match="implausible"):
        by_manual.velocity(frame)


def test_the_fastest_plausible_velocity_is_taken() -> None:
    by_driver = Wire(feedback_angular_unit="milliradian")
    velocity = Translator(by_driver, Vehicle()).velocity(VelocityReport(-5000, 10_000))
    assert (velocity.linear, velocity.angular) == (-5.0, 10.0)


def test_mileage(by_manual: Translator) -> None:
    mileage = by_manual.mileage(DistanceReport(-1234, -1800), epoch=3)
    assert (mileage.distance, mileage.epoch) == (-1.234, 3)
    assert mileage.heading == pytest.approx(-math.pi)


def test_ultrasonic_says_why_there_is_no_range(by_manual: Translator) -> None:
    frame = UltrasonicReport((1000, 0xFFFF, 0, 49, 50, 4999, 5000, 0xFFFE))
    message = by_manual.ultrasonic(frame)
    assert message.ranges == (1.0, None, None, None, 0.05, 4.999, None, None)
    assert message.status == (
        "ok", "fault", "too_near", "too_near", "ok", "ok", "no_echo", "no_echo",
    )  # fmt: skip


def test_driver_faults_by_name_all_32_bits() -> None:
    message = driver(DriverReport(Side.LEFT, 0b11111 | 1 << 5 | 1 << 31))
    assert message.faults == (
        "over_current", "over_voltage", "encoder", "under_voltage", "overload", "bit_5", "bit_31",
    )  # fmt: skip
    assert message.bits == 0x8000003F
    assert driver(DriverReport(Side.RIGHT, 0)).faults == ()


@pytest.mark.parametrize(
    ("samples", "levels", "hits"),
    [
        ("1", "1", "1"),
        ("000", "--0", "000"),
        ("00010", "--011", "00010"),
        ("0001000", "--01110", "0001000"),
        ("00011001000", "--011111110", "00010000000"),
        ("0001000100", "--01110111", "0001000100"),
    ],
)
def test_a_hit_needs_one_sample_and_clear_three(samples: str, levels: str, hits: str) -> None:
    bumper, shown, found = BumperFilter(), "", ""
    for sample in samples:
        found += str(int(bumper.take(sample == "1")))
        shown += {None: "-", True: "1", False: "0"}[bumper.pressed]
    assert (shown, found) == (levels, hits)


# --- counters that restarted ----------------------------------------------------------------------


def at(distance: float, heading: float = 0.0) -> Mileage:
    return Mileage(distance=distance, heading=heading, epoch=0)


def deg(distance: float, degrees: float) -> Mileage:
    return at(distance, math.radians(degrees))


NEAR_M, NEAR_RAD = ZERO_M + DRIVEN_MPS * 0.1, ZERO_RAD + TURNED_RADPS * 0.1
STEP_M, STEP_RAD = STEP_TO_ZERO + DRIVEN_MPS * 0.1, STEP_TO_ZERO + TURNED_RADPS * 0.1


@pytest.mark.parametrize(
    ("before", "after", "gap_s", "unbroken", "anew"),
    [
        # to zero: sooner than any driving
        (at(-5.0), at(0.0), 0.02, False, True),
        (deg(0.0, -179.0), at(0.0), 0.02, False, True),
        (at(0.051), at(0.0), 0.02, False, True),
        (at(0.049), at(0.0), 0.02, False, False),
        (at(0.051), at(0.0051), 0.02, False, False),
        (at(0.051), deg(0.0, 0.6), 0.02, False, False),
        (deg(0.0, 3.5), at(0.0), 0.02, False, True),
        (deg(0.0, 3.4), at(0.0), 0.02, False, False),
        (at(0.3), at(ZERO_M), 0.1, True, True),
        (at(0.3), at(0.0, ZERO_RAD), 0.1, True, True),
        (at(STEP_M), at(0.0), 0.1, True, False),
        (at(0.0, STEP_RAD), at(0.0), 0.1, True, False),
        # through zero, with samples missing
        (at(0.3), at(0.0), 0.2, False, False),
        (at(0.33), at(0.0), 0.2, False, True),
        (at(0.33), at(0.0), 60.0, False, True),
        (at(0.33), at(0.0), 60.0, True, True),
        # anywhere: further than the vehicle can have moved
        (at(5.0), at(6.099), 0.02, False, False),
        (at(5.0), at(6.101), 0.02, False, True),
        (at(5.0), at(6.9), 0.2, False, False),
        (at(5.0), at(7.1), 60.0, False, True),
        (deg(5.0, 0.0), deg(5.0, 62.0), 0.02, False, False),
        (deg(5.0, 0.0), deg(5.0, 64.0), 0.02, False, True),
        (at(0.0), at(STEP + FAST_MPS * 0.1), 0.1, True, False),
        (at(0.0), at(0.0, STEP + FAST_RADPS * 0.1), 0.1, True, False),
        (at(5.0, 1.5), at(5.0, 1.5), 0.1, True, False),
        (deg(5.0, 179.9), deg(5.0, -179.9), 0.02, False, False),  # the wrap is no jump
        # counters alone that were silent went on as far as it can drive
        (at(5.0), at(25.9), 4.0, True, False),
        (at(5.0), at(26.1), 4.0, True, True),
        (deg(5.0, 0.0), deg(5.0, 179.0), 4.0, True, False),
        (deg(5.0, 0.0), deg(5.0, 64.0), 0.02, True, True),
    ],
)
def test_restarted(
    before: Mileage, after: Mileage, gap_s: float, unbroken: bool, anew: bool
) -> None:
    assert restarted(before, after, gap_s, unbroken=unbroken, silent=False) is anew


@pytest.mark.parametrize(
    ("before", "after", "anew"),
    [
        (at(0.2), at(0.0), True),
        (at(-0.3), at(-0.1), True),
        (at(0.3), at(-0.1), True),
        (at(0.171), at(0.0), True),
        (at(0.169), at(0.0), False),
        (at(0.06), at(0.03), False),  # it drove past the place where it was powered on
        (at(0.4), at(0.154), True),
        (at(0.4), at(0.156), False),  # a board that came back cannot have counted so much
        (deg(0.0, -20.0), deg(0.0, 7.0), True),
        (deg(0.0, 12.7), at(0.0), True),
        (deg(0.0, 12.5), at(0.0), False),
        (deg(0.2, 24.0), deg(0.1, 11.3), True),
        (deg(0.2, 24.0), deg(0.1, 11.5), False),
        (at(1.0), at(NEAR_M), True),
        (at(1.0, 1.0), at(0.0, NEAR_RAD), True),
        (at(0.0, 1.0), at(0.0, 0.5), False),
        (at(STEP_M), at(0.0), False),
        (at(0.0, STEP_RAD), at(0.0), False),
    ],
)
def test_after_a_silence_counters_that_are_nearer_to_zero_have_begun_anew(
    before: Mileage, after: Mileage, anew: bool
) -> None:
    assert restarted(before, after, 0.1, unbroken=True, silent=True) is anew
    assert not restarted(before, after, 0.15, unbroken=True, silent=False)
