"""Link and CRC of a good board, a slow one, a silent one and another firmware."""

from typing import Any

import pytest

from cli.commission.link import (
    CRC_FRAMES,
    EXPECTED_HZ,
    NONZERO_FRAMES,
    judge_link,
    rejected,
)
from cli.commission.report import Verdict
from common.freshness import NS_PER_S
from common.messages import Link, Relay, Switches
from tests import factories

ON = Switches(ultrasonic_brake=True, bumper_brake=True)


def link(**fields: Any) -> Link:
    return factories.link(**({"rates": dict(EXPECTED_HZ), "round_trip": 0.002} | fields))


def judge(
    switches: Switches | None = ON,
    frames: int = CRC_FRAMES,
    nonzero: int = NONZERO_FRAMES,
    **last: Any,
) -> Verdict:
    """Judge five seconds of link messages; the last one differs."""
    good = [link(mono_ns=round(i * 0.2 * NS_PER_S)) for i in range(25)]
    return judge_link([*good, link(mono_ns=5 * NS_PER_S, **last)], switches, frames, nonzero)


def test_a_good_link_passes_with_its_data() -> None:
    verdict = judge(rejected={"bad_value": 1}, ports={"BumperReport": 4001})
    assert verdict.outcome == "passed"
    assert verdict.text == "The board's link is up: 1000 frames, no bad CRC."
    data = dict(verdict.data)
    assert data["BumperReport, Hz"] == "50 of 50"
    assert data["accepted frames"] == "1000, 50 of these with a nonzero payload"
    assert data["round trip"] == "2.0 ms"
    assert data["rejected in this step"] == "bad_value 1"
    assert data["received at port"] == "BumperReport 4001"
    assert dict(judge(round_trip=None).data)["round trip"] == "unknown"
    assert data["waiting for"] == "nothing"


@pytest.mark.parametrize(
    ("last", "phrase"),
    [
        ({"state": "lost"}, "The link is lost"),
        ({"state": "never"}, "The link is never"),
        ({"epoch": 1}, "restarted during this step"),
        ({"rejected": {"wrong_address": 20}}, "20 frames rejected as wrong_address"),
    ],
)
def test_problems_are_named(last: dict[str, Any], phrase: str) -> None:
    verdict = judge(**last)
    assert verdict.outcome == "failed"
    assert phrase in verdict.text


@pytest.mark.parametrize(
    "switches",
    [
        None,
        Switches(ultrasonic_brake=True, bumper_brake=None),
        Switches(ultrasonic_brake=False, bumper_brake=True),
    ],
)
def test_the_emergency_brakes_must_be_confirmed(switches: Switches | None) -> None:
    verdict = judge(switches)
    assert verdict.outcome == "failed"
    assert "both its emergency brakes" in verdict.text


@pytest.mark.parametrize(("rate", "outcome"), [(14.0, "passed"), (13.9, "failed"), (0, "failed")])
def test_lowest_allowed_rate(rate: float, outcome: str) -> None:
    links = [link(rates=EXPECTED_HZ | {"UltrasonicReport": rate})] * 5
    assert judge_link(links, ON, CRC_FRAMES, NONZERO_FRAMES).outcome == outcome


def test_a_missing_report_is_named() -> None:
    rates = {name: rate for name, rate in EXPECTED_HZ.items() if name != "BumperReport"}
    verdict = judge_link([link(rates=rates)], ON, CRC_FRAMES, NONZERO_FRAMES)
    assert verdict.text == "BumperReport has 0 Hz, expected are 50 Hz."


@pytest.mark.parametrize(("count", "outcome"), [(5, "passed"), (6, "failed")])
def test_one_in_a_hundred_may_be_damaged(count: int, outcome: str) -> None:
    # 109 frames a second for five seconds: 545 frames
    assert judge(rejected={"truncated": count}).outcome == outcome


def test_only_rejections_of_the_step_count() -> None:
    links = [
        link(rejected={"bad_crc": 3, "no_magic": 1}),
        link(rejected={"bad_crc": 5, "no_magic": 1}),
    ]
    assert rejected(links) == {"bad_crc": 2}


@pytest.mark.parametrize(
    ("frames", "nonzero"), [(CRC_FRAMES - 1, 900), (CRC_FRAMES, NONZERO_FRAMES - 1)]
)
def test_too_few_frames(frames: int, nonzero: int) -> None:
    verdict = judge(frames=frames, nonzero=nonzero)
    assert verdict.outcome == "failed"
    assert verdict.text.startswith("Too few frames for a verdict")


@pytest.mark.parametrize(
    ("bad", "frames", "phrase"),
    [(1, 1000, "check the cable"), (499, 501, "check the cable"), (500, 500, "another CRC")],
)
def test_a_bad_cable_and_another_firmware_differ(bad: int, frames: int, phrase: str) -> None:
    verdict = judge(frames=frames, rejected={"bad_crc": bad})
    assert verdict.outcome == "failed"
    assert phrase in verdict.text


@pytest.mark.parametrize(
    ("state", "braking", "text", "passed"),
    [
        ("up", "", "0.1.0, passing", True),
        ("up", "silent", "0.1.0, braking: silent", False),
        ("lost", "", "silent", False),
    ],
)
def test_a_configured_relay_must_pass_commands(
    state: Any, braking: str, text: str, passed: bool
) -> None:
    relay = Relay(state=state, version="0.1.0", braking=braking, uptime=1.0, counters={})
    verdict = judge(relay=relay)
    assert ("relay", text) in verdict.data
    assert (verdict.outcome == "passed") == passed
    assert ("relay did not pass" in verdict.text) != passed
