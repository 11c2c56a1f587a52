"""Motions, as three things are heard of them: commands, velocities and the board's counters."""

import math
from dataclasses import dataclass, replace

import pytest

from cli.commission.motion import (
    RATIO,
    SETTLE_NS,
    WINDOW_NS,
    Run,
    judge_motion,
    measure,
    stood_after_s,
    too_fast,
    unit_of,
)
from cli.commission.verdict import Verdict
from common.freshness import NS_PER_S, Latest
from common.messages import Mileage, Motion, Velocity
from common.motion import Command, Twist
from tests.cli.demo.lap_fixture import safety

FORWARD, LEFT = Twist(linear=0.1), Twist(angular=0.2)
PERIOD_NS = NS_PER_S // 50
MRAD = 0.001 / math.radians(0.1)  # 0.573: what a firmware in milliradians makes of our command


@dataclass(frozen=True)
class Vehicle:
    """What a made-up vehicle does with a command, as factors on it."""

    counted: float = 1.0
    measured: float = 1.0
    across: float = 0.0  # counted on the other axis, in its unit per second
    driven_s: float = 2.0
    let_through: float = 1.0  # by safety
    starts_at: float = 3.1  # heading, rad: it wraps on the way
    stands_after_s: float = 0.2

    def run(self, asked: Twist, unit: str = "decidegree", feedback: str = "decidegree") -> Run:
        end_ns = round(self.driven_s * NS_PER_S)
        times = range(0, end_ns + NS_PER_S, PERIOD_NS)
        released = [t <= end_ns for t in times]
        moving = [t <= end_ns + self.stands_after_s * NS_PER_S for t in times]
        linear, angular = asked.linear * self.let_through, asked.angular * self.let_through
        turns = asked.angular != 0
        speed = (angular if turns else linear) * self.counted
        way = [speed * min(t, end_ns) / NS_PER_S for t in times]
        aside = [self.across * min(t, end_ns) / NS_PER_S for t in times]
        distances, headings = (aside, way) if turns else (way, aside)
        return Run(
            asked=asked,
            unit=unit,
            feedback=feedback,
            released_ns=end_ns,
            motions=[
                Latest(Motion(command=Command.RUN, linear=linear * on, angular=angular * on), t)
                for t, on in zip(times, released, strict=True)
            ],
            velocities=[
                Latest(
                    Velocity(
                        linear=linear * self.measured * on, angular=angular * self.measured * on
                    ),
                    t,
                )
                for t, on in zip(times, moving, strict=True)
            ],
            mileages=[
                Latest(
                    Mileage(
                        distance=distance,
                        heading=math.remainder(self.starts_at + heading, math.tau),
                        epoch=0,
                        mono_ns=t,
                    ),
                    t,
                )
                for t, distance, heading in zip(times, distances, headings, strict=True)
            ],
            states=[
                Latest(safety("blocked"), 0),
                Latest(safety(), 1),
                Latest(safety("blocked"), 2),
            ],
        )


def judge(vehicle: Vehicle, asked: Twist = FORWARD, unit: str = "decidegree") -> Verdict:
    return judge_motion(vehicle.run(asked, unit))


@pytest.mark.parametrize("asked", [FORWARD, LEFT])
def test_a_good_vehicle_passes(asked: Twist) -> None:
    verdict = judge(Vehicle(), asked)
    assert verdict.outcome == "passed", verdict
    assert dict(verdict.data)["counted by commanded"] == "1.000"
    assert dict(verdict.data)["stood still after"] == "0.22 s"


def test_the_heading_is_counted_over_its_wrap() -> None:
    measured = measure(Vehicle(starts_at=math.pi - 0.1).run(LEFT))
    assert measured is not None
    assert measured.counted == pytest.approx(0.2)


@pytest.mark.parametrize("off", [RATIO - 0.01, RATIO + 0.01, -RATIO + 0.01, -RATIO - 0.01])
def test_a_quarter_off_is_too_much(off: float) -> None:
    verdict = judge(Vehicle(counted=1 + off, measured=1 + off))
    assert verdict.outcome == ("passed" if abs(off) < RATIO else "failed")


@pytest.mark.parametrize(
    ("asked", "vehicle", "said"),
    [
        (FORWARD, Vehicle(counted=0.0, measured=0.0), "No motion: neither the velocity nor the di"),
        (FORWARD, Vehicle(0.0, 0.0, across=0.1), "It turns instead."),
        (LEFT, Vehicle(0.0, 0.0, across=0.1), "It drives instead of turning."),
        (FORWARD, Vehicle(counted=0.0), "but the distance does not count."),
        (LEFT, Vehicle(counted=0.0), "a gyroscope counts only on the ground."),
        (
            FORWARD,
            Vehicle(counted=-1.0, measured=-1.0),
            "The sign is wrong: commanded",
        ),
        (FORWARD, Vehicle(counted=-1.0, measured=-1.0), "it goes backward."),
        (LEFT, Vehicle(counted=-1.0, measured=-1.0), "it goes clockwise."),
        (FORWARD, Vehicle(measured=-1.0), "The measured velocity has the wrong sign"),
        (
            LEFT,
            Vehicle(counted=-MRAD, measured=-MRAD),
            'wire.command_angular_unit = "milliradian".',
        ),
        (FORWARD, Vehicle(counted=2.0, measured=2.0), "It goes 2.00 times as fast as commanded."),
        (FORWARD, Vehicle(measured=2.0), "2.00 times the velocity of the counter."),
        (FORWARD, Vehicle(stands_after_s=5.0), "It did not stand within 2 s"),
        (FORWARD, Vehicle(driven_s=0.8), "not let through for long enough to measure."),
        (FORWARD, Vehicle(let_through=0.5), "Safety said: blocked"),
    ],
)
def test_what_is_wrong_is_named(asked: Twist, vehicle: Vehicle, said: str) -> None:
    verdict = judge(vehicle, asked)
    assert verdict.outcome == "failed"
    assert said in verdict.text


@pytest.mark.parametrize(
    ("unit", "counted", "said"),
    [
        ("decidegree", MRAD, 'set wire.command_angular_unit = "milliradian"'),
        ("milliradian", 1 / MRAD, 'set wire.command_angular_unit = "decidegree"'),
        ("decidegree", 5.73, "seems to be 0.01 rad/s, for which there is no setting"),
        ("decidegree", 0.1, None),
        ("decidegree", 10.0, "seems to be 1 deg/s"),
        ("decidegree", 3.0, "It goes 3.00 times as fast as commanded."),
    ],
)
def test_a_unit_is_known_by_its_factor(unit: str, counted: float, said: str | None) -> None:
    # The firmware measures in the unit that it takes, so what comes back looks right.
    verdict = judge(Vehicle(counted=counted), LEFT, unit)
    assert verdict.outcome == "failed"
    assert (said or "does not count") in verdict.text


@pytest.mark.parametrize(
    ("feedback", "measured", "said"),
    [
        ("decidegree", 1 / MRAD, 'set wire.feedback_angular_unit = "milliradian"'),
        ("milliradian", MRAD, 'set wire.feedback_angular_unit = "decidegree"'),
        ("decidegree", 10.0, "seems to be 0.01 deg/s, for which there is no setting"),
        ("decidegree", 3.0, "The measured velocity is 3.00 times the velocity of the counter."),
        ("decidegree", 0.0, "The measured velocity is 0.00 times the velocity of the counter."),
    ],
)
def test_the_unit_of_the_feedback_is_known_by_the_counter(
    feedback: str, measured: float, said: str
) -> None:
    verdict = judge_motion(Vehicle(measured=measured).run(LEFT, feedback=feedback))
    assert verdict.outcome == "failed"
    assert said in verdict.text
    assert "command_angular_unit" not in verdict.text


def test_units_hint_at_turns_alone() -> None:
    assert "angular_unit" not in judge(Vehicle(counted=MRAD, measured=MRAD)).text


@pytest.mark.parametrize(
    ("ratio", "unit"), [(0.573, "milliradian"), (0.5, "milliradian"), (0.48, None), (1.0, None)]
)
def test_a_unit_must_match(ratio: float, unit: str | None) -> None:
    assert unit_of(ratio, "decidegree") == unit


def test_the_window_must_be_long_enough() -> None:
    shortest_s = (SETTLE_NS + WINDOW_NS) / NS_PER_S
    assert measure(Vehicle(driven_s=shortest_s).run(FORWARD)) is not None
    assert measure(Vehicle(driven_s=shortest_s - 0.02).run(FORWARD)) is None


def test_a_pause_in_between_is_not_measured_over() -> None:
    run = Vehicle().run(FORWARD)
    pause = Latest(Motion(command=Command.STOP), NS_PER_S)
    motions = sorted([*run.motions, pause], key=lambda motion: motion.received_ns)
    assert measure(replace(run, motions=motions)) is None


def test_what_was_seen_of_a_wild_vehicle_is_said() -> None:
    verdict = judge(Vehicle(driven_s=0.4, measured=-6.0), LEFT)
    assert "At most -1.20 rad/s were measured of 0.20 asked. Safety said: blocked" in verdict.text


def test_nothing_heard_is_nothing_measured() -> None:
    run = Vehicle().run(FORWARD)
    parts = run.unit, run.feedback, run.released_ns, run.motions
    assert measure(Run(FORWARD, *parts, [], run.mileages, [])) is None
    assert measure(Run(FORWARD, *parts, run.velocities, run.mileages[:1], [])) is None
    verdict = judge_motion(Run(FORWARD, *parts[:3], [], [], [], []))
    assert verdict.text == (
        "The full speed was not let through for long enough to measure. "
        "At most 0.00 m/s were measured of 0.10 asked."
    )
    assert verdict.data == (("stood still after", "never"),)


def test_who_moves_again_has_not_stood() -> None:
    run = Vehicle().run(FORWARD)
    again = Latest(Velocity(linear=0.1, angular=0.0), run.velocities[-1].received_ns + 1)
    moved = [*run.velocities, again]
    assert (
        stood_after_s(Run(FORWARD, run.unit, run.unit, run.released_ns, [], moved, [], [])) is None
    )


@pytest.mark.parametrize(
    ("asked", "linear", "angular", "ends"),
    [
        (FORWARD, 0.3, 0.0, False),
        (FORWARD, -0.31, 0.0, True),
        (FORWARD, 0.1, 0.61, True),
        (LEFT, 0.0, 0.6, False),
        (LEFT, 0.0, -0.61, True),
        (LEFT, 0.31, 0.0, True),
    ],
)
def test_three_times_what_is_asked_ends_it(
    asked: Twist, linear: float, angular: float, ends: bool
) -> None:
    assert too_fast(asked, Velocity(linear=linear, angular=angular)) is ends
