"""Diagnosis of an observation: bridge to wheels."""

from typing import Any, get_args

import pytest
from msgspec.structs import replace

from cli.inspect import remedies
from cli.inspect.diagnosis import Observation
from cli.inspect.vehicle import STREAMS, diagnose_vehicle
from common import keys
from common import messages as m
from common.messages import FaultName
from services.safety.core.causes import RULES
from tests.cli.inspect.tool import health

CLEAR: Any = ("ok",) * 8
RATES = {topic.path: topic.rate_hz for topic in STREAMS}
NO_MESSAGE = m.Message()


def link(state: Any = "up", **given: Any) -> m.Link:
    healthy: dict[str, Any] = {"board": "10.7.5.224:4002", "epoch": 0, "armed": True, "waiting": "",
                            "rates": {}, "rejected": {}, "round_trip": 0.002}  # fmt: skip
    return m.Link(state=state, **(healthy | given))


def relay(state: Any = "up", **given: Any) -> m.Link:
    usual: dict[str, Any] = {"version": "1", "braking": "", "uptime": 60.0, "counters": {}}
    return link(relay=m.Relay(state=state, **(usual | given)))


def state(*names: str, latched: tuple[str, ...] = ()) -> m.SafetyState:
    texts = {rule.name: (rule.action, rule.text) for rule in RULES}
    causes = tuple(
        m.Cause(name=n, action=action, age=1.0, text=text)
        for n in names
        for action, text in [texts.get(n, ("stop", n))]
    )
    return m.SafetyState(
        verdict="stop", latched=latched, causes=causes, source=None, heartbeat=1,
        limits=m.Limits(forward=1, backward=1, angular=1), text="All is well.",
    )  # fmt: skip


def seen(*messages: m.Message, **given: Any) -> Observation:
    """Return the observation of a healthy robot, with the given differences."""
    side = keys.DRIVER.path.format
    newest: dict[str, m.Message] = {
        keys.LINK.path: link(),
        keys.SWITCHES.path: m.Switches(ultrasonic_brake=True, bumper_brake=True),
        keys.BUMPER.path: m.Bumper(pressed=False),
        keys.ULTRASONIC.path: m.Ultrasonic(ranges=(1.0,) * 8, status=CLEAR),
        side(side="left"): m.Driver(faults=(), bits=0),
        side(side="right"): m.Driver(faults=(), bits=0),
        keys.SAFETY.path: state("no_request"),
    }
    for message in messages:
        for path, other in newest.items():
            if type(other) is type(message):
                newest[path] = message
                break
    newest |= given.pop("newest", {})
    healthy: dict[str, Any] = {"instances": {"bridge": 1}, "rates": RATES, "first": newest}
    return Observation(zenoh="1", t2="1", newest=newest, **(healthy | given))


def found(observed: Observation, where: str = "") -> list[tuple[str, str, str]]:
    """Return level, text and remedy of the findings in one place; of all that are not ok."""
    return [
        (each.level, each.text, each.todo)
        for each in diagnose_vehicle(observed)
        if (each.where == where if where else each.level != "ok")
    ]


def test_a_healthy_vehicle() -> None:
    assert found(seen()) == []


@pytest.mark.parametrize(
    ("message", "problems"),
    [
        (m.Bumper(pressed=True), [("wrong", "the bumper is pressed", remedies.BUMPER)]),
        (m.Ultrasonic(ranges=(None,) * 3 + (1.0,) * 5,
                      status=("fault", "too_near", "no_echo", *CLEAR[3:])), [
            ("wrong", "the left sonar is faulty", remedies.SONAR_FAULT),
            ("wrong", "the front left sonar is covered: an object is below its minimum range",
             remedies.SONAR_NEAR)]),
        (m.Driver(faults=("encoder", "bit_9"), bits=0x204), [
            ("wrong", "the left motor driver reports encoder: invalid encoder signal: "
             "the encoder's cable", remedies.DRIVER),
            ("wrong", "the left motor driver reports bit_9: not documented in the manual",
             remedies.DRIVER)]),
        (m.Switches(ultrasonic_brake=False, bumper_brake=True),
         [("wrong", "the board's ultrasonic brake is off", remedies.SWITCHES)]),
        (m.Switches(ultrasonic_brake=True),
         [("wrong", "the board's bumper brake is not confirmed", remedies.SWITCHES)]),
        (link(armed=False, waiting="link lost"),
         [("note", "the bridge accepts no motion now: link lost", "")]),
        (relay("lost"), [("wrong", "the relay is silent", remedies.RELAY)]),
        (relay("never", version=""),
         [("wrong", "no report of the relay received", remedies.RELAY)]),
        (relay(braking="silent"),
         [("wrong", "the relay sends BRAKE: silent", remedies.RELAY_BRAKES["silent"])]),
        (relay(braking="new"), [("wrong", "the relay sends BRAKE: new", "")]),
        (relay(version="2"), [("note", "the relay is T2 2, this laptop 1", remedies.RELAY_UPDATE)]),
        (state("contact", "neutral", latched=("contact",)), [
            ("wrong", "The bumper was hit. (brake, latched)", remedies.BUMPER),
            ("note", "Waiting for a neutral request: release the controls, then drive. (stop)",
             remedies.CAUSES["neutral"])]),
        (state("smoke", latched=("smoke",)),
         [("wrong", "smoke (stop, latched)", remedies.RESET)]),
        (state("smoke"), [("wrong", "smoke (stop)", "")]),
        (state(), []),
    ],
)  # fmt: skip
def test_problems(message: m.Message, problems: list[tuple[str, str, str]]) -> None:
    assert found(seen(message)) == problems


@pytest.mark.parametrize(
    ("name", "todo"), [("never", remedies.BOARD_NEVER), ("lost", remedies.BOARD_LOST)]
)
def test_without_the_board_its_sensors_are_unknown(name: str, todo: str) -> None:
    reported = found(seen(link(name), m.Bumper(pressed=True)))
    assert [(level, remedy) for level, _, remedy in reported] == [("wrong", todo), ("unknown", "")]


def test_without_messages_the_rest_is_unknown() -> None:
    reported = list(diagnose_vehicle(Observation(zenoh="1", t2="1")))
    assert [(each.where, each.level) for each in reported] == [
        ("link", "unknown"), ("safety", "unknown"),
    ]  # fmt: skip
    silent = {keys.LINK.path: NO_MESSAGE}
    assert found(seen(newest=silent), "link") == [
        ("unknown", "the bridge does not report the board", "")
    ]
    left = keys.DRIVER.path.format(side="left")
    absent = seen(newest=dict.fromkeys((keys.BUMPER.path, keys.ULTRASONIC.path, left), NO_MESSAGE))
    assert [len(found(absent, where)) for where in ("bumper", "sonar", "drivers")] == [0, 0, 1]


def test_frames_rejected_and_unsent_during_the_observation() -> None:
    before = link(rejected={"bad_crc": 4, "no_magic": 1}, send_errors=4)
    now = link(rejected={"bad_crc": 9, "no_magic": 1}, send_errors=7)
    observed = seen(now, first={keys.LINK.path: before})
    assert found(observed, "link") == [
        ("note", "the bridge rejects frames of the board: 5 bad_crc", remedies.BOARD_REFUSED),
        ("wrong", "the system failed to send 3 datagrams to the board", remedies.SEND_ERRORS),
        ("ok", "the board at 10.7.5.224:4002 is up, answers in 2.0 ms", ""),
    ]
    assert found(seen(now)) == []


def test_streams_that_are_slow_missing_or_downsampled() -> None:
    sent = replace(
        health("bridge"),
        rates={f"t2/v1/001/{path}": hz for path, hz in RATES.items() if "mileage" not in path},
    )
    rates = RATES | {
        "tel/bridge/bumper": 0.0, "tel/bridge/mileage": 12.0, "tel/bridge/velocity": 10.0,
    }  # fmt: skip
    observed = seen(rates=rates, newest={"tel/bridge/health": sent})
    text = "of what the robot sends, this laptop receives a part: velocity 10 of 50 Hz"
    assert found(observed, "sensors") == [
        ("note", "tel/bridge/mileage has 12 of 25 Hz", remedies.SILENT),
        ("wrong", "tel/bridge/bumper is sent with 50 Hz and does not arrive here",
         remedies.NOT_HERE),
        ("note", text, remedies.DOWNSAMPLED),
    ]  # fmt: skip
    assert found(seen(rates=rates), "sensors")[-1][:2] == (
        "wrong", "tel/bridge/bumper has 0 of 50 Hz",
    )  # fmt: skip


def test_every_cause_and_every_fault_has_a_remedy() -> None:
    assert remedies.CAUSES.keys() == {rule.name for rule in RULES}
    assert remedies.FAULTS.keys() == set(get_args(FaultName))
