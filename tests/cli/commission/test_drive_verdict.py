"""Verdicts on a manoeuvre by synthetic messages, and the conditions to begin."""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import pytest
from msgspec.structs import replace as replaced

from cli.commission.drive_verdict import (
    Drive,
    judge_drive,
    judge_standstill,
    recorder_problem,
    switches_problem,
)
from cli.commission.manoeuvres import Manoeuvre, homing, plan, standstill
from cli.commission.supervision import Problem
from common.freshness import NS_PER_S, Latest
from common.motion import STILL, Twist
from services.safety.config import SafetyConfig
from t2.messages import Command, Health, Mileage, Motion, Switches, Velocity
from tests.factories import safety_state

SETTINGS = SafetyConfig()
PERIOD_NS = NS_PER_S // 50
END_S = 2.0  # of the requests


def manoeuvre(title: str) -> Manoeuvre:
    return next(it for it in plan(SETTINGS) if it.title.startswith(title))


STOP, BRAKE = manoeuvre("STOP forward from 0.50"), manoeuvre("BRAKE forward from 0.50")
SLOW, TURN = manoeuvre("Slow down forward from 0.50"), manoeuvre("STOP left from 0.50")
CURVE = manoeuvre("STOP forward turning left")


@dataclass(frozen=True)
class Vehicle:
    """A vehicle at its speed, which falls from the end of the requests on."""

    factor: float = 1.0  # of the granted speed
    granted: float = 1.0
    counted: float = 1.0
    deceleration: float = 0.6  # m/s^2, or rad/s^2 of a turn
    reaction: float = 0.1  # s
    command: Command = Command.STOP
    brake_after: float = math.inf  # s, after the stop
    ripple: float = 0.0  # m/s and rad/s

    def drive(self, it: Manoeuvre, **more: Any) -> Drive:
        full = it.twist.scaled(self.granted)
        top = max(abs(full.linear), abs(full.angular))
        motions, velocities, mileages = [], [], []
        way = Twist(7.0, 3.0)
        for number in range(250):
            after_s = number / 50 - END_S
            left = top - self.deceleration * max(0.0, after_s - self.reaction)
            speed = full.scaled(self.factor * max(0.0, left) / top if top else 0.0)
            now_ns = NS_PER_S + number * PERIOD_NS
            wave = self.ripple * (-1) ** number
            motions.append(Latest(self._motion(full, after_s, now_ns), now_ns))
            velocities.append(
                Latest(
                    Velocity(
                        linear=speed.linear + wave, angular=speed.angular + wave, mono_ns=now_ns
                    ),
                    now_ns,
                )
            )
            heading = math.remainder(way.angular, math.tau)
            mileage = Mileage(distance=way.linear, heading=heading, epoch=0, mono_ns=now_ns)
            mileages.append(Latest(mileage, now_ns))
            way = Twist(
                way.linear + self.counted * speed.linear / 50,
                way.angular + self.counted * speed.angular / 50,
            )
        states = [Latest(safety_state(verdict="slow", text="Near."), 2 * NS_PER_S)]
        fields: dict[str, Any] = {"ended_ns": round((1 + END_S) * NS_PER_S), "stood": True}
        made = Drive(it, motions=motions, velocities=velocities, mileages=mileages, bumpers=[],
                     states=states, **fields)  # fmt: skip
        return replace(made, **more)

    def _motion(self, full: Twist, after_s: float, now_ns: int) -> Motion:
        if after_s < 0:
            return Motion(
                command=Command.RUN, linear=full.linear, angular=full.angular, mono_ns=now_ns
            )
        braked = after_s >= self.brake_after
        return Motion(command=Command.BRAKE if braked else self.command, mono_ns=now_ns)


GOOD = Vehicle()


@pytest.mark.parametrize(
    ("it", "vehicle", "text", "data"),
    [
        (STOP, GOOD, "It has travelled +1.26 m, as expected.", {"deceleration": "0.60 m/s2"}),
        (STOP, Vehicle(ripple=0.04), "It has travelled +1.26 m", {"reaction": "unknown"}),
        (TURN, Vehicle(deceleration=1.0), "turned +68 degrees", {"reckoned": "0.260 rad"}),
        (BRAKE, Vehicle(command=Command.BRAKE, deceleration=9.0), "It has travelled", {}),
        (SLOW, Vehicle(command=Command.RUN), "travelled +1.26 m", {"measured": "+0.500 m/s"}),
        (CURVE, GOOD, "+0.98 m and turned +56 deg", {"deceleration": "0.60 m/s2; 0.60 rad/s2"}),
    ],
)  # fmt: skip
def test_as_expected(it: Manoeuvre, vehicle: Vehicle, text: str, data: dict[str, str]) -> None:
    verdict = judge_drive(vehicle.drive(it), SETTINGS).verdict
    assert verdict.outcome == "passed", verdict.text
    assert text in verdict.text
    assert data.items() <= dict(verdict.data).items()


LONG = "The stop was too long: from 0.50 m/s it needs "


@pytest.mark.parametrize(
    ("it", "vehicle", "text", "then"),
    [
        (STOP, Vehicle(deceleration=0.4), "set vehicle.deceleration to at most 0.40", "slower"),
        (STOP, Vehicle(reaction=0.3), "set safety.react to at least 0.40 s (it is 0.25)", "slower"),
        (STOP, Vehicle(reaction=0.3, deceleration=0.4), "(it is 0.25) and vehicle.decel", "slower"),
        (STOP, Vehicle(deceleration=0.4, ripple=0.04), f"{LONG}0.42", "slower"),
        (TURN, Vehicle(deceleration=0.5), "angular_deceleration to at most 0.50", "slower"),
        (STOP, Vehicle(brake_after=0.3), "Safety commanded BRAKE after the STOP", "slower"),
        (STOP, Vehicle(granted=0.6), "at most 0.30 m/s of 0.50 m/s. It reports: Near.", "again"),
        (STOP, Vehicle(factor=0.7), "the board measures +0.35 m/s, granted are +0.50", "again"),
        (TURN, Vehicle(factor=0.7), "check wire.command_angular_unit and", "again"),
        (STOP, Vehicle(factor=0.0), "No motion: 0.00 m are counted on a request", "again"),
        (STOP, Vehicle(counted=0.7), "Counters and velocities differ by 30%: counted +0.8", "end"),
        (BRAKE, GOOD, "It ended by STOP instead.", "again"),
    ],
)  # fmt: skip
def test_problems(it: Manoeuvre, vehicle: Vehicle, text: str, then: str) -> None:
    result = judge_drive(vehicle.drive(it), SETTINGS)
    assert result.verdict.outcome == "failed"
    assert text in result.verdict.text
    assert result.then == then


@pytest.mark.parametrize(
    ("more", "text", "then"),
    [
        ({"problem": Problem("Drift.", "again")}, "Drift.", "again"),
        ({"stood": False}, "It does not stand", "end"),
        ({"is_steady": False}, "The speed was not steady", "again"),
        ({"velocities": []}, "No velocities or no counters", "end"),
        ({"motions": []}, "Safety granted at most 0 m/s of 0.50 m/s. It had", "again"),
    ],
)
def test_what_the_session_has_found(more: dict[str, Any], text: str, then: str) -> None:
    result = judge_drive(GOOD.drive(STOP, **more), SETTINGS)
    assert result.verdict.text.startswith(text)
    assert result.then == then


def test_a_stop_without_counters_cannot_be_measured() -> None:
    drive = GOOD.drive(STOP)
    early = [one for one in drive.mileages if one.received_ns < drive.ended_ns]
    found = judge_drive(replace(drive, mileages=early), SETTINGS).verdict
    assert found.text.startswith("The stop cannot be measured: 1 counters are missing.")
    rare = replace(drive, velocities=drive.velocities[::4])
    found = judge_drive(rare, SETTINGS).verdict
    assert found.text == "The stop cannot be measured: a velocity arrives each 0.08 s only."


def test_a_short_way_back_need_not_reach_its_speed() -> None:
    back = homing(0.06, SETTINGS)
    assert back is not None
    drive = Vehicle(factor=0.5, command=Command.RUN).drive(back)
    assert judge_drive(drive, SETTINGS).verdict.outcome == "passed"


def test_standstill() -> None:
    stands = Vehicle().drive(standstill(), motions=[])
    found = judge_standstill(stands)
    assert found.verdict.text == "It stands."
    assert dict(found.verdict.data)["noise"] == "0.0000 m/s, 0.0000 rad/s"


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"velocities": []}, "No velocities or no counters:"),
        ({"motions": Vehicle().drive(STOP).motions}, "Another program drives: end it first."),
        ({"velocities": Vehicle().drive(STOP).velocities}, "At standstill the board measures +0.2"),
        ({"velocities": Vehicle().drive(standstill()).velocities[::5]}, "A velocity arrives each "),
    ],
)
def test_no_standstill(change: dict[str, Any], text: str) -> None:
    found = judge_standstill(Vehicle().drive(standstill(), **{"motions": [], **change}))
    assert found.verdict.text.startswith(text)
    assert found.then == "end"


def health(boot: int, *recorded: int, service: str = "recorder", host: int = 5) -> list[Health]:
    one = Health(
        service=service, version="", uptime=1.0, rates={}, counters={}, lateness=0.0, rss=0
    )
    return [replaced(one, boot=boot, host=host, counters={"recorded": count}) for count in recorded]


@pytest.mark.parametrize(
    ("messages", "problem"),
    [
        (health(1, 5, 900), ""),
        ([*health(1, 0, 0), *health(2, 5, 900)], ""),  # the black box, and `t2 record`
        ([*health(2, 5, 900, host=8), *health(3, 5, 900)], ""),
        ([], "No recorder is running: start `t2 record` on the robot"),
        (health(1, 5, 900, service="metrics"), "No recorder is running"),
        (health(1, 0, 0), "The recorder keeps incidents only"),
        (health(1, 900, 900), "or its disk is full"),
        (health(1, 900), "The recorder keeps incidents only"),
        (health(1, 5, 900, host=8), "The recorder is on another computer"),
    ],
)
def test_the_recorder(messages: list[Health], problem: str) -> None:
    found = recorder_problem(messages, 5)
    assert problem in found
    assert bool(found) is bool(problem)
    assert not recorder_problem(health(1, 5, 900, host=8), 0)  # the host is unknown


@pytest.mark.parametrize(
    ("switches", "confirmed"),
    [
        (Switches(ultrasonic_brake=True, bumper_brake=True), True),
        (Switches(ultrasonic_brake=True), False),
        (Switches(ultrasonic_brake=True, bumper_brake=False), False),
        (None, False),
    ],
)
def test_the_switches(switches: Switches | None, confirmed: bool) -> None:
    assert (not switches_problem(switches)) is confirmed


def test_the_synthetic_vehicle_counts_what_it_drives() -> None:
    drive = GOOD.drive(STOP)
    steps = [b.value.distance - a.value.distance for a, b in pairwise(drive.mileages)]
    assert sum(steps) == pytest.approx(0.5 * (END_S + 0.1) + 0.5**2 / 1.2, abs=0.01)
    assert drive.velocities[-1].value.linear == STILL.linear
