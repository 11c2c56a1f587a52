"""Diagnosis of an observation: bridge to wheels."""

from typing import Any, get_args

import pytest
from msgspec.structs import replace

from cli.inspect import remedies
from cli.inspect.diagnosis import Finding, Observation
from cli.inspect.vehicle import STREAMS, diagnose_vehicle, drivers, driving, link, safety, switches
from common import messages as m
from common.messages import FaultName
from services.safety.core.causes import RULES
from tests.cli.inspect.tool import health

CLEAR: Any = ("ok",) * 8


def link_of(state: Any = "up", **given: Any) -> m.Link:
    healthy: dict[str, Any] = {"board": "10.7.5.224:4002", "epoch": 0, "armed": True, "waiting": "",
                            "rates": {}, "rejected": {}, "round_trip": 0.002}  # fmt: skip
    return m.Link(state=state, **(healthy | given))


def state_of(*names: str, latched: tuple[str, ...] = ()) -> m.SafetyState:
    texts = {rule.name: (rule.action, rule.text) for rule in RULES}
    causes = tuple(
        m.Cause(
            name=n, action=texts.get(n, ("stop", ""))[0], age=1.0, text=texts.get(n, ("", n))[1]
        )
        for n in names
    )
    return m.SafetyState(
        verdict="stop", latched=latched, causes=causes, source=None, heartbeat=1,
        limits=m.Limits(forward=1, backward=1, angular=1), text="All is well.",
    )  # fmt: skip


def seen(**given: Any) -> Observation:
    """Return the observation of a healthy robot, with the given differences."""
    healthy: dict[str, Any] = {
        "link": link_of(), "switches": m.Switches(ultrasonic_brake=True, bumper_brake=True),
        "bumper": m.Bumper(pressed=False),
        "ultrasonic": m.Ultrasonic(ranges=(1.0,) * 8, status=CLEAR),
        "drivers": {side: m.Driver(faults=(), bits=0) for side in ("left", "right")},
        "instances": {"bridge": 1}, "safety": state_of("no_request"),
        "rates": {topic.path: topic.rate_hz for topic in STREAMS},
    }  # fmt: skip
    return Observation(zenoh="1", t2="1", **(healthy | given))


def wrong(found: Any) -> list[tuple[str, str]]:
    """Return problems and remedies."""
    return [(each.text, each.todo) for each in found if each.level == "wrong"]


def test_a_healthy_vehicle() -> None:
    assert {each.level for each in diagnose_vehicle(seen())} == {"ok"}


def test_without_a_bridge_the_board_is_unknown() -> None:
    found = list(diagnose_vehicle(Observation(zenoh="1", t2="1")))
    assert [(each.where, each.level) for each in found] == [
        ("link", "unknown"), ("driving", "ok"), ("safety", "unknown"),
    ]  # fmt: skip


def test_a_bridge_without_link_messages() -> None:
    (found,) = (each for each in diagnose_vehicle(seen(link=None)) if each.where == "link")
    assert (found.level, found.text) == ("unknown", "the bridge does not report the board")


@pytest.mark.parametrize(
    ("state", "todo"), [("never", remedies.BOARD_NEVER), ("lost", remedies.BOARD_LOST)]
)
def test_an_absent_board(state: str, todo: str) -> None:
    found = list(diagnose_vehicle(seen(link=link_of(state), bumper=m.Bumper(pressed=True))))
    assert [each[1] for each in wrong(found)] == [todo]
    assert Finding("sensors", "unknown", "no sensor data without the board") in found


def test_frames_rejected_during_the_observation() -> None:
    before, now = link_of(rejected={"bad_crc": 4, "no_magic": 1}), {"bad_crc": 9, "no_magic": 1}
    first, second = link(link_of(rejected=now), before)
    assert (first.level, first.todo) == ("note", remedies.BOARD_REFUSED)
    assert first.text.endswith("of the board: 5 bad_crc")
    assert second.text.endswith("is up, answers in 2.0 ms")
    assert [each.level for each in link(link_of(round_trip=None), None)] == ["ok"]


def test_datagrams_unsent_during_the_observation() -> None:
    first, second = link(link_of(send_errors=7), link_of(send_errors=4))
    assert (first.level, first.todo) == ("wrong", remedies.SEND_ERRORS)
    assert first.text == "the system failed to send 3 datagrams to the board"
    assert second.level == "ok"
    assert [each.level for each in link(link_of(send_errors=7), link_of(send_errors=7))] == ["ok"]


def test_a_bridge_that_accepts_no_motion() -> None:
    found = list(link(link_of(armed=False, waiting="link lost"), None))
    assert found[-1].level == "note"
    assert "link lost" in found[-1].text


@pytest.mark.parametrize(
    ("message", "phrase"),
    [
        (m.Switches(ultrasonic_brake=False, bumper_brake=True), ["ultrasonic brake is off"]),
        (m.Switches(ultrasonic_brake=True), ["bumper brake is not confirmed"]),
        (None, ["ultrasonic brake is not confirmed", "bumper brake is not confirmed"]),
    ],
)
def test_switches(message: m.Switches | None, phrase: list[str]) -> None:
    found = wrong(switches(seen(switches=message)))
    assert [text for text, _ in found] == [f"the board's {each}" for each in phrase]
    assert {todo for _, todo in found} == {remedies.SWITCHES}


def test_streams_that_are_missing_or_slow() -> None:
    rates = {topic.path: topic.rate_hz for topic in STREAMS}
    rates |= {"tel/bridge/bumper": 0.0, "tel/bridge/mileage": 12.0, "tel/bridge/velocity": 25.0}
    found = [each for each in diagnose_vehicle(seen(rates=rates)) if each.where == "sensors"]
    assert [(each.level, each.text) for each in found] == [
        ("note", "tel/bridge/mileage has 12 of 25 Hz"),
        ("wrong", "tel/bridge/bumper has 0 of 50 Hz"),
    ]


def test_streams_that_the_router_downsamples_are_no_fault_of_the_board() -> None:
    paths = {topic.path: topic.rate_hz for topic in STREAMS}
    bridge = replace(
        health("bridge"),
        rates={f"t2/v1/001/{path}": hz for path, hz in paths.items() if "odom" not in path},
    )
    rates = {path: min(10.0, hz) for path, hz in paths.items()} | {"tel/bridge/bumper": 0.0}
    found = list(diagnose_vehicle(seen(rates=rates, health={"bridge": bridge})))
    sensors = [each for each in found if each.where == "sensors"]
    assert [(each.level, each.text, each.todo) for each in sensors] == [
        (
            "wrong",
            "tel/bridge/bumper is sent with 50 Hz and does not arrive here",
            remedies.NOT_HERE,
        ),
        ("note", "tel/odom/odometry has 10 of 25 Hz", remedies.SILENT),
        (
            "note",
            "of what the robot sends, this laptop receives a part: "
            "velocity 10 of 50 Hz, mileage 10 of 25 Hz",
            remedies.DOWNSAMPLED,
        ),
    ]


def test_no_finding_without_a_message() -> None:
    where = {each.where for each in diagnose_vehicle(seen(bumper=None, ultrasonic=None))}
    assert not where & {"bumper", "sonar"}


def test_a_pressed_bumper_and_untrusted_sonars() -> None:
    status: Any = ("fault", "too_near", "no_echo", *CLEAR[3:])
    message = m.Ultrasonic(ranges=(None,) * 3 + (1.0,) * 5, status=status)
    found = wrong(diagnose_vehicle(seen(bumper=m.Bumper(pressed=True), ultrasonic=message)))
    assert found == [
        ("the bumper is pressed", remedies.BUMPER),
        ("the left sonar is faulty", remedies.SONAR_FAULT),
        (
            "the front left sonar is covered: an object is below its minimum range",
            remedies.SONAR_NEAR,
        ),
    ]


def test_driver_faults_have_their_meaning() -> None:
    message = {"left": m.Driver(faults=("encoder", "bit_9"), bits=0x204)}
    texts = [text for text, _ in wrong(drivers(message))]
    assert "left motor driver reports encoder: invalid encoder signal" in texts[0]
    assert "bit_9: not documented in the manual" in texts[1]


def test_duplicate_sources() -> None:
    (found,) = driving(seen(requests={"web": {1, 2}}))
    assert (found.level, found.todo) == ("wrong", remedies.ONE_DRIVER)
    (found,) = driving(seen(requests={"web": {1}, "teleop": {2}}))
    assert (found.level, found.text.split(" request")[0]) == ("note", "teleop, web")
    (found,) = driving(seen(requests={"web": {1}}))
    assert (found.level, found.text) == ("ok", "web requests motion")
    found = next(driving(seen(motion={1, 2})))
    assert (found.level, found.todo) == ("wrong", remedies.TWICE)


def test_causes_of_safety_have_remedies() -> None:
    latched, passing = safety(seen(safety=state_of("contact", "neutral", latched=("contact",))))
    assert (latched.level, latched.todo) == ("wrong", remedies.BUMPER)
    assert latched.text == "The bumper was hit. (brake, latched)"
    assert (passing.level, passing.todo) == ("note", remedies.CAUSES["neutral"])


def test_an_unknown_cause() -> None:
    (found,) = safety(seen(safety=state_of("smoke", latched=("smoke",))))
    assert (found.level, found.todo) == ("wrong", remedies.RESET)
    (found,) = safety(seen(safety=state_of("smoke")))
    assert (found.level, found.todo) == ("wrong", "")


def test_no_cause() -> None:
    (found,) = safety(seen(safety=state_of()))
    assert (found.level, found.text) == ("ok", "All is well.")


def test_every_cause_and_every_fault_has_a_remedy() -> None:
    assert remedies.CAUSES.keys() == {rule.name for rule in RULES}
    assert remedies.FAULTS.keys() == set(get_args(FaultName))


def relay_of(state: Any = "up", **given: Any) -> m.Relay:
    usual: dict[str, Any] = {"version": "1", "braking": "", "uptime": 60.0, "counters": {}}
    return m.Relay(state=state, **(usual | given))


@pytest.mark.parametrize(
    ("relay", "found"),
    [
        (None, []),
        (relay_of(), [("ok", "the relay passes commands, up for 60 s", "")]),
        (relay_of("lost"), [("wrong", "the relay is silent", remedies.RELAY)]),
        (relay_of("never", version=""),
         [("wrong", "no report of the relay received", remedies.RELAY)]),
        (relay_of(braking="silent"),
         [("wrong", "the relay sends BRAKE: silent", remedies.RELAY_BRAKES["silent"])]),
        (relay_of(braking="new"), [("wrong", "the relay sends BRAKE: new", "")]),
        (relay_of(version="2"), [
            ("ok", "the relay passes commands, up for 60 s", ""),
            ("note", "the relay is T2 2, this laptop 1", remedies.RELAY_UPDATE)]),
    ],
)  # fmt: skip
def test_a_configured_relay(relay: m.Relay | None, found: list[tuple[str, str, str]]) -> None:
    all_findings = diagnose_vehicle(seen(link=link_of(relay=relay)))
    assert [(f.level, f.text, f.todo) for f in all_findings if f.where == "relay"] == found
