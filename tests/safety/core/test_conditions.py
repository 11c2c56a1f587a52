"""Conditions: what each input and each state raises, exactly."""

from typing import Any

import pytest
from msgspec.structs import replace

from common.freshness import NS_PER_S, Latest
from common.motion import Twist
from common.settings import Board
from common.standstill import Displacement
from services.safety.config import LimitSource, SafetyConfig
from services.safety.core.arbiter import Arbiter, DriveChannel
from services.safety.core.conditions import observe_inputs, samples
from services.safety.core.inputs import Inputs
from services.safety.core.motion_watch import MotionWatch, Phase, Standstill
from services.safety.core.policy import Policy
from services.safety.core.speed_limits import LimitChannel, SpeedLimits
from services.safety.core.state import State, Verdict
from t2.messages import Bumper, Driver, Phrase, Switches, Ultrasonic, Velocity
from t2.words import render
from tests.factories import link, safety_state

NOW_NS = 100 * NS_PER_S
BOOT, SEQ, OWN = 7, 40, 5
STAMP: dict[str, int] = {"boot": BOOT, "seq": SEQ}
SETTINGS = SafetyConfig()
LIDAR = LimitSource(lease=0.5, silence="stop")


def newest(message: Any, age_s: float = 0.0) -> Latest[Any]:
    return Latest(message, NOW_NS - round(age_s * NS_PER_S))


GOOD = Inputs(
    velocity=newest(Velocity(linear=0.0, angular=0.0)),
    ultrasonic=newest(Ultrasonic(ranges=(1.0,) * 8, status=("ok",) * 8)),
    bumper=newest(Bumper(pressed=False, **STAMP)),
    left=newest(Driver(faults=(), bits=0, **STAMP)),
    right=newest(Driver(faults=(), bits=0, **STAMP)),
    switches=newest(Switches(ultrasonic_brake=True, bumper_brake=True)),
    link=newest(link(boot=BOOT)),
    estop_connection=1,
    estop_path=newest(safety_state()),
    boot=OWN,
)
STATE = Policy(SETTINGS).start()


def observed(
    inputs: Inputs, state: State = STATE, settings: SafetyConfig = SETTINGS
) -> dict[str, str]:
    """Return the texts of the causes that are shown, by name."""
    seen = observe_inputs(inputs, settings, state, NOW_NS)
    texts: dict[str, str] = {one.name: render(one.phrases) for one in seen}
    assert len(texts) == len(seen), "each cause is observed once"
    return texts


def test_good_inputs_show_nothing() -> None:
    assert observed(GOOD) == {}
    sample = (BOOT, SEQ)
    assert samples(GOOD) == {"contact": sample, "driver_left": sample, "driver_right": sample}


def test_without_inputs_the_first_samples_are_due() -> None:
    assert observed(Inputs()) == {
        "starting": "Waiting for the first sample of: velocity, ultrasonic, bumper, left driver, "
        "right driver, link, switches, emergency stop.",
    }
    assert samples(Inputs()) == {}


def bumper(age_s: float = 0.0, **fields: Any) -> dict[str, Any]:
    return {"bumper": newest(Bumper(**{"pressed": False, **STAMP, **fields}), age_s)}


def driver(side: str, *faults: str, bits: int = 0, age_s: float = 0.0) -> dict[str, Any]:
    return {side: newest(Driver(faults=faults, bits=bits, **STAMP), age_s)}


def linked(age_s: float = 0.0, **fields: Any) -> dict[str, Any]:
    return {"link": newest(link(boot=BOOT, **fields), age_s)}


def switched(ultrasonic: bool | None, strip: bool | None, age_s: float = 0.0) -> dict[str, Any]:
    return {"switches": newest(Switches(ultrasonic_brake=ultrasonic, bumper_brake=strip), age_s)}


# Inputs that differ from the good ones, the observed cause, and its text; None: it is absent.
BY_INPUTS: list[tuple[dict[str, Any], str, str | None]] = [
    (bumper(pressed=True), "contact", ""),
    ({"estop": True}, "estop", ""),
    (linked(estop=3), "estop", ""),
    (driver("left", "over_current", "bit_31", bits=9), "driver_left",
     "The left motor driver reports: over current, bit 31."),
    (driver("right", bits=16), "driver_right", "The right motor driver reports: bits 0x10."),
    (driver("right", "encoder"), "driver_right", "The right motor driver reports: encoder."),
    ({"leaving": True}, "leaving", ""),
    ({"estop_connection": 0}, "starting", "Waiting for the first sample of: emergency stop."),
    ({"estop_path": None}, "starting",
     "Waiting for the first sample of: the path of the emergency stop."),
    ({"switches": None}, "starting", "Waiting for the first sample of: switches."),
    (linked(state="lost"), "link", "The link to the board is lost."),
    (linked(state="never"), "link", "No frame came from the board yet."),
    (linked(state="lost", armed=False), "unarmed", None),
    (linked(armed=False), "unarmed", "The bridge is not armed yet."),
    (linked(armed=False, waiting_phrases=(Phrase("waiting.ready"),)), "unarmed",
     "The bridge is not armed yet. The board is not ready."),
    (linked(latched_by=9), "predecessor", ""),
    (linked(latched_by=BOOT), "predecessor",
     "The vehicle moved without a command while safety was absent."),
    (linked(latched_by=OWN), "predecessor", None),
    (switched(False, True), "switches", ""),
    (switched(True, None), "switches", ""),
    (bumper(0.07), "bumper", None),
    (bumper(0.071), "bumper", ""),
    ({"velocity": newest(Velocity(linear=0.0, angular=0.0), 0.201)}, "silent",
     "No recent data: velocity."),
    (linked(0.601), "silent", "No recent data: link."),
    (switched(True, True, 3.01), "silent", "No recent data: switches."),
    (driver("left", age_s=2.01) | driver("right", age_s=2.01), "silent",
     "No recent data: left driver, right driver."),
    (driver("left", age_s=2.0) | driver("right", age_s=2.0), "silent", None),
    ({"estop_path": newest(safety_state(), 0.201)}, "silent",
     "No recent data: the path of the emergency stop."),
]  # fmt: skip


def check(name: str, text: str | None, *given: Any) -> None:
    assert observed(*given).get(name) == text


@pytest.mark.parametrize(("changes", "name", "text"), BY_INPUTS)
def test_an_input_raises_its_cause(changes: dict[str, Any], name: str, text: str | None) -> None:
    check(name, text, replace(GOOD, **changes))


@pytest.mark.parametrize(("changes", "name"), [
    ({"switches": None}, "starting"), ({"switches": None}, "switches"),
    (switched(None, False), "switches"), (switched(True, True, 3.01), "silent"),
])  # fmt: skip
def test_unneeded_switches_raise_nothing(changes: dict[str, Any], name: str) -> None:
    lax = SafetyConfig(board=Board(require_switches=False))
    check(name, None, replace(GOOD, **changes), STATE, lax)


def decided(age_s: float) -> dict[str, Any]:
    return {"decided_ns": NOW_NS - round(age_s * NS_PER_S)}


def stands(**fields: Any) -> dict[str, Any]:
    return {"motion": MotionWatch(standstill=Standstill(**fields))}


LATE = {"phase": Phase.STOPPING, "due_ns": NOW_NS - 1}
TWICE: dict[str, Any] = {"boot": 1, "seq": 1, "lease_ns": NOW_NS, "conflict_ns": NOW_NS}
STALLED = "Safety was stalled: an emergency stop may have been missed."
PENDANT = LimitSource(lease=1.0, silence="latch")
# States that differ from the first one, likewise.
BY_STATE: list[tuple[dict[str, Any], str, str | None]] = [
    (decided(1.0), "estop_reader", None),
    (decided(1.001), "estop_reader", STALLED),
    ({"estop_connection": 2}, "estop_reader", ""),
    ({"estop_connection": 1}, "estop_reader", None),
    ({"speed_limits": SpeedLimits({"pendant": PENDANT})}, "starting",
     "Waiting for the emergency stop keepalive of pendant."),
    ({"verdict": Verdict(judged=(8, SEQ))}, "bumper", "The bridge has restarted."),
    ({"verdict": Verdict(judged=(BOOT, SEQ - 3))}, "bumper", None),
    ({"verdict": Verdict(judged=(BOOT, SEQ - 4))}, "bumper", "Samples of the bumper were lost."),
    (decided(0.07), "silent", None),
    (decided(0.071), "silent", "Safety was stalled: samples received meanwhile may be old."),
    ({"motion": MotionWatch(runs_away=True)}, "runaway", ""),
    (stands(has_left=True), "uncommanded_motion", ""),
    (stands(**LATE), "not_stopping", "Standstill is not confirmed: no velocity is received."),
    (stands(**LATE, displacement=Displacement(steady=Twist(0.25, -0.5))), "not_stopping",
     "The vehicle does not stop: 0.25 m/s, -0.50 rad/s."),
    ({"arbiter": Arbiter(SETTINGS.safety.sources, {"teleop": DriveChannel(**TWICE)}),
      "speed_limits": SpeedLimits({"lidar": LIDAR}, {"lidar": LimitChannel(**TWICE)})},
     "two_publishers", "Two programs send as teleop, limit lidar."),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "name", "text"), BY_STATE)
def test_a_state_raises_its_cause(changes: dict[str, Any], name: str, text: str | None) -> None:
    check(name, text, GOOD, replace(STATE, **changes))


def test_an_emergency_stop_of_the_bridge_counts_once() -> None:
    check("estop", None, replace(GOOD, **linked(estop=3)), replace(STATE, estop=3))
    check("estop", "", replace(GOOD, **linked(estop=4)), replace(STATE, estop=3))
