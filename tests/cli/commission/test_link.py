"""Link and CRC of a good board, a slow one, a silent one and another firmware."""

from typing import Any

import pytest
from msgspec.structs import replace

from cli.commission.link import EXPECTED_HZ, judge_link, rejected
from cli.commission.report import Verdict
from common.freshness import NS_PER_S
from common.messages import Link, Relay, Switches
from tests import factories

ON = Switches(ultrasonic_brake=True, bumper_brake=True)


def link(**fields: Any) -> Link:
    return factories.link(**({"rates": dict(EXPECTED_HZ)} | fields))


def judge(switches: Switches | None = ON, **last: Any) -> Verdict:
    """Judge five seconds of link messages; the last one differs."""
    good = [link(mono_ns=round(i * 0.2 * NS_PER_S)) for i in range(25)]
    return judge_link([*good, link(mono_ns=5 * NS_PER_S, **last)], switches)


def test_a_good_link_passes_with_its_data() -> None:
    verdict = judge(rejected={"bad_value": 1}, ports={"BumperReport": 4001})
    assert verdict.outcome == "passed"
    assert verdict.text == "The board's link is up: 545 frames, no bad CRC."
    data = dict(verdict.data)
    assert data["BumperReport, Hz"] == "50 of 50"
    assert data["rejected"] == "bad_value 1"
    assert data["received at port"] == "BumperReport 4001"


RELAY = Relay(state="up", version="0.1.0", braking="", uptime=1.0, counters={})


@pytest.mark.parametrize(
    ("given", "phrase"),
    [
        ({"state": "lost"}, "The link is lost"),
        ({"epoch": 1}, "restarted during this step"),
        ({"rejected": {"wrong_address": 20}}, "20 frames rejected as wrong_address"),
        ({"rejected": {"truncated": 5}}, ""),  # one in a hundred of 545 frames
        ({"rejected": {"truncated": 6}}, "6 frames rejected as truncated"),
        ({"switches": None}, "both its emergency brakes"),
        ({"switches": Switches(ultrasonic_brake=True)}, "both its emergency brakes"),
        ({"rejected": {"bad_crc": 544}}, "check the cable"),
        ({"rejected": {"bad_crc": 545}}, "another CRC"),
        ({"rates": EXPECTED_HZ | {"UltrasonicReport": 0.0}}, ""),  # once: the median counts
        ({"relay": RELAY}, ""),
        ({"relay": replace(RELAY, braking="silent")}, "now: 0.1.0, braking: silent."),
        ({"relay": replace(RELAY, state="lost")}, "now: silent."),
    ],
)
def test_problems_are_named(given: dict[str, Any], phrase: str) -> None:
    verdict = judge(**given)
    assert (verdict.outcome == "passed") == (not phrase)
    assert phrase in verdict.text


def test_only_rejections_of_the_step_count() -> None:
    before, after = ({"bad_crc": bad, "no_magic": 1} for bad in (3, 5))
    assert rejected([link(rejected=before), link(rejected=after)]) == {"bad_crc": 2}


@pytest.mark.parametrize(("rate", "outcome"), [(14.0, "passed"), (13.9, "failed")])
def test_lowest_allowed_rate(rate: float, outcome: str) -> None:
    links = [link(rates=EXPECTED_HZ | {"UltrasonicReport": rate})] * 5
    assert judge_link(links, ON).outcome == outcome
