"""Link and CRC: what a good board, a slow one, a silent one and another firmware come to."""

from dataclasses import dataclass, field
from typing import Any

import pytest

from cli.commission.link import (
    CRC_FRAMES,
    TELLING_FRAMES,
    Ports,
    asked_rates,
    judge_crc,
    judge_link,
    rejected,
)
from cli.commission.verdict import Verdict
from common.freshness import NS_PER_S
from common.messages import Link, Switches

SETTINGS = {
    "bridge.bumper_rate": 50.0,
    "bridge.mileage_rate": 50.0,
    "bridge.ultrasonic_rate": 20.0,
    "bridge.driver_rate": 2.0,
}
ASKED = asked_rates(SETTINGS)
ON = Switches(ultrasonic_brake=True, bumper_brake=True)
BOTH = Ports((4002, 4001), 200)


def link(**fields: Any) -> Link:
    known: dict[str, Any] = {
        "state": "up",
        "board": "10.7.5.224:4002",
        "epoch": 0,
        "armed": True,
        "waiting": "",
        "rates": dict(ASKED),
        "rejected": {},
        "round_trip": 0.002,
    }
    return Link(**(known | fields))


@dataclass
class Heard:
    """Five seconds of a link; the last message differs in ``fields``."""

    fields: dict[str, Any] = field(default_factory=dict)

    def messages(self) -> list[Link]:
        good = [link(mono_ns=round(i * 0.2 * NS_PER_S)) for i in range(25)]
        return [*good, link(mono_ns=5 * NS_PER_S, **self.fields)]


def judge(switches: Switches | None = ON, ports: Ports = BOTH, **last: Any) -> Verdict:
    return judge_link(Heard(last).messages(), switches, ASKED, ports)


def test_a_good_link_passes_with_its_data() -> None:
    verdict = judge(rejected={"bad_value": 1})
    assert (verdict.outcome, verdict.text) == ("passed", "The board is heard.")
    data = dict(verdict.data)
    assert data["BumperReport, Hz"] == "50 (asked 50)"
    assert data["VelocityReport, Hz"] == "10 (at least 10)"
    assert data["DriverReport, Hz"] == "4 (asked 4)"
    assert data["round trip"] == "2.0 ms"
    assert data["rejected in this step"] == "bad_value 1"
    assert data["waiting for"] == "nothing"


@pytest.mark.parametrize(
    ("last", "said"),
    [
        ({"state": "lost"}, "The link is lost"),
        ({"state": "never"}, "The link is never"),
        ({"epoch": 1}, "started anew"),
        ({"rejected": {"wrong_address": 20}}, "20 rejected as wrong_address"),
    ],
)
def test_what_is_wrong_is_named(last: dict[str, Any], said: str) -> None:
    verdict = judge(**last)
    assert verdict.outcome == "failed"
    assert said in verdict.text


@pytest.mark.parametrize(
    "switches",
    [
        None,
        Switches(ultrasonic_brake=True, bumper_brake=None),
        Switches(ultrasonic_brake=False, bumper_brake=True),
    ],
)
def test_the_emergency_brakes_must_be_echoed(switches: Switches | None) -> None:
    verdict = judge(switches)
    assert verdict.outcome == "failed"
    assert "both its emergency brakes" in verdict.text


@pytest.mark.parametrize(("rate", "outcome"), [(14.0, "passed"), (13.9, "failed"), (0, "failed")])
def test_a_rate_must_be_near_what_was_asked(rate: float, outcome: str) -> None:
    links = [link(rates=ASKED | {"UltrasonicReport": rate})] * 5
    assert judge_link(links, ON, ASKED, BOTH).outcome == outcome


def test_a_kind_that_never_comes_is_named() -> None:
    rates = {name: rate for name, rate in ASKED.items() if name != "BumperReport"}
    verdict = judge_link([link(rates=rates)], ON, ASKED, BOTH)
    assert verdict.text == "BumperReport comes at 0 Hz, expected are 50."


@pytest.mark.parametrize(("count", "outcome"), [(6, "passed"), (7, "failed")])
def test_one_in_a_hundred_may_be_damaged(count: int, outcome: str) -> None:
    # 134 frames a second for five seconds: 670 frames
    assert judge(rejected={"truncated": count}).outcome == outcome


def test_bad_crcs_are_the_next_step_s() -> None:
    assert judge(rejected={"bad_crc": 500}).outcome == "passed"


@pytest.mark.parametrize(
    ("ports", "said"),
    [
        (BOTH, "4002 and 4001; both carry what the board says"),
        (Ports((4002, 4001), 0), "4002 and 4001; only one carries what the board says"),
        (Ports((4002, 4001), None), "4002 and 4001; which carry something is unknown"),
        (Ports((4002,), 0), "4002, the only one that is set"),
    ],
)
def test_which_ports_carry_something(ports: Ports, said: str) -> None:
    verdict = judge(ports=ports, round_trip=None)
    assert verdict.outcome == "passed"
    assert dict(verdict.data)["ports"] == said
    assert dict(verdict.data)["round trip"] == "unknown"


def test_only_what_was_rejected_meanwhile_counts() -> None:
    links = [
        link(rejected={"bad_crc": 3, "no_magic": 1}),
        link(rejected={"bad_crc": 5, "no_magic": 1}),
    ]
    assert rejected(links) == {"bad_crc": 2}


# --- CRC ----------------------------------------------------------------------------------------


def crc(bad: int, frames: int = CRC_FRAMES, telling: int = TELLING_FRAMES) -> Verdict:
    return judge_crc([link(), link(rejected={"bad_crc": bad} if bad else {})], frames, telling)


def test_a_thousand_good_frames_pass() -> None:
    verdict = crc(0)
    assert (verdict.outcome, verdict.text) == ("passed", "1000 frames, no bad CRC.")


@pytest.mark.parametrize(
    ("frames", "telling"), [(CRC_FRAMES - 1, 900), (CRC_FRAMES, TELLING_FRAMES - 1), (0, 0)]
)
def test_too_few_prove_nothing(frames: int, telling: int) -> None:
    verdict = crc(0, frames, telling)
    assert verdict.outcome == "failed"
    assert verdict.text.startswith("Too few frames to tell")


@pytest.mark.parametrize(
    ("bad", "frames", "said"),
    [
        (1, 1000, "look at the cable"),
        (499, 501, "look at the cable"),
        (500, 500, "t2 wire identify-crc"),
        (7, 0, "t2 wire identify-crc"),
    ],
)
def test_a_bad_cable_and_another_firmware_differ(bad: int, frames: int, said: str) -> None:
    verdict = crc(bad, frames)
    assert verdict.outcome == "failed"
    assert said in verdict.text
    assert dict(verdict.data)["bad CRCs in this step"] == str(bad)
