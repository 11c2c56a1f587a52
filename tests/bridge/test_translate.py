"""Frames to SI and back."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import WireError
from common.messages import Bumper, Motion
from common.motion import Command
from common.settings import AngularUnit, Vehicle, Wire
from common.wire.commands import MotionCommand, MotionKind
from common.wire.frame import Side
from common.wire.reports import DistanceReport, DriverReport, UltrasonicReport, VelocityReport
from services.bridge.translate import BumperFilter, Translator, driver


@pytest.fixture
def by_manual() -> Translator:
    return Translator(Wire(), Vehicle(), 1.0, 1.0)


@pytest.fixture
def by_driver() -> Translator:
    return Translator(
        Wire(command_angular_unit="milliradian", feedback_angular_unit="milliradian"),
        Vehicle(),
        1.0,
        1.0,
    )


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
        (run(0.0004, 0.0), 0, 0),
    ],
)
def test_run_carries_the_motion_clamped(
    by_manual: Translator, motion: Motion, linear_mmps: int, angular_raw: int
) -> None:
    frame = by_manual.command(Command.RUN, motion)
    assert frame == MotionCommand(MotionKind.RUN, linear_mmps, angular_raw)
    assert b"\x00\x80" not in frame.to_bytes()


def test_the_angular_unit_is_a_setting_both_ways(
    by_manual: Translator, by_driver: Translator
) -> None:
    assert by_driver.command(Command.RUN, run(0.0, 0.3)).angular_raw == 300
    assert by_driver.velocity(VelocityReport(0, 300)).angular == pytest.approx(0.3)
    assert by_manual.velocity(VelocityReport(0, 300)).angular == pytest.approx(math.radians(30))


@pytest.mark.parametrize(
    ("command", "feedback", "raw", "angular"),
    [("milliradian", "decidegree", 300, math.radians(30)), ("decidegree", "milliradian", 172, 0.3)],
)
def test_each_way_has_a_unit_of_its_own(
    command: AngularUnit, feedback: AngularUnit, raw: int, angular: float
) -> None:
    wire = Wire(command_angular_unit=command, feedback_angular_unit=feedback)
    mixed = Translator(wire, Vehicle(), 1.0, 1.0)
    assert mixed.command(Command.RUN, run(0.0, 0.3)).angular_raw == raw
    assert mixed.velocity(VelocityReport(0, 300)).angular == pytest.approx(angular)


def test_the_widest_settings_still_fit_fifteen_bits() -> None:
    wide = Translator(
        Wire(command_angular_unit="milliradian", feedback_angular_unit="milliradian"),
        Vehicle(),
        100.0,
        100.0,
    )
    frame = wide.command(Command.RUN, run(32.0, 99.0))
    assert (frame.linear_mmps, frame.angular_raw) == (32000, 32767)


@pytest.mark.parametrize(
    ("order", "kind"), [(Command.STOP, MotionKind.STOP), (Command.BRAKE, MotionKind.BREAK)]
)
def test_stop_and_brake_carry_no_velocity(
    by_manual: Translator, order: Command, kind: MotionKind
) -> None:
    assert by_manual.command(order, run(1.0, 1.0)) == MotionCommand(kind, 0, 0)
    assert by_manual.command(order) == MotionCommand(kind, 0, 0)


@given(st.integers(-5000, 5000), st.integers(-5729, 5729))
def test_velocities_come_back_as_they_went(linear_mmps: int, angular_raw: int) -> None:
    free = Translator(Wire(), Vehicle(), 100.0, 100.0)
    velocity = free.velocity(VelocityReport(linear_mmps, angular_raw))
    frame = free.command(Command.RUN, run(velocity.linear, velocity.angular))
    assert (frame.linear_mmps, frame.angular_raw) == (linear_mmps, angular_raw)


@pytest.mark.parametrize(
    "frame", [VelocityReport(5001, 0), VelocityReport(-5001, 0), VelocityReport(0, 5730)]
)
def test_a_velocity_that_no_vehicle_has_is_refused(
    by_manual: Translator, frame: VelocityReport
) -> None:
    with pytest.raises(WireError, match="implausible"):
        by_manual.velocity(frame)


def test_the_fastest_plausible_velocity_is_taken(by_driver: Translator) -> None:
    velocity = by_driver.velocity(VelocityReport(-5000, 10_000))
    assert (velocity.linear, velocity.angular) == (-5.0, 10.0)


def test_a_run_without_a_motion_carries_no_velocity(by_manual: Translator) -> None:
    assert by_manual.command(Command.RUN) == MotionCommand(MotionKind.RUN, 0, 0)


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
    bumper = BumperFilter()
    taken = [bumper.take(sample == "1") for sample in samples]
    shown = {None: "-", Bumper(pressed=True): "1", Bumper(pressed=False): "0"}
    assert "".join(shown[message] for message, _ in taken) == levels
    assert "".join(str(int(hit)) for _, hit in taken) == hits
