"""Link and CRC of a good board, a slow one, a silent one and another firmware."""

from typing import Any

import pytest
from msgspec.structs import replace

from cli.commission.link import EXPECTED_HZ, judge_link, rejected
from cli.commission.report import Verdict
from common.freshness import NS_PER_S
from t2.messages import Link, Relay, Switches
from tests import factories

ON = Switches(ultrasonic_brake=True, bumper_brake=True)


def link(**fields: Any) -> Link:
    return factories.link(**({"rates": dict(EXPECTED_HZ)} | fields))


def judge(switches: Switches | None = ON, **last: Any) -> Verdict:
    """Judge ten seconds of link messages; the last one differs."""
    good = [link(mono_ns=round(i * 0.2 * NS_PER_S)) for i in range(50)]
    return judge_link([*good, link(mono_ns=10 * NS_PER_S, **last)], switches)


RELAY = Relay(state="up", version="0.1.0", braking="", uptime=1.0, counters={})


@pytest.mark.parametrize(
    ("given", "phrase"),
    [
        ({"state": "lost"}, "The link is lost"),
        ({"epoch": 1}, "restarted during this step"),
        ({"rejected": {"wrong_address": 20}}, "20 frames rejected as wrong_address"),
        ({"rejected": {"truncated": 10}}, ""),  # one in a hundred of 1090 frames
        ({"rejected": {"truncated": 11}}, "11 frames rejected as truncated"),
        ({"switches": None}, "both its emergency brakes"),
        ({"switches": Switches(ultrasonic_brake=True)}, "both its emergency brakes"),
        ({"rejected": {"bad_crc": 1089}}, "check the cable"),
        ({"rejected": {"bad_crc": 1090}}, "another CRC"),
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


def test_a_bridge_that_was_seen_for_a_part_of_the_step_gives_no_verdict() -> None:
    few = [link(mono_ns=i * NS_PER_S) for i in range(4)]
    for links, frames in ((few, 327), (few[:1], 0)):
        verdict = judge_link(links, ON)
        assert verdict.outcome == "failed"
        assert f"Too few frames for a verdict: {frames}." in verdict.text


def test_only_rejections_of_the_step_count() -> None:
    before, after = ({"bad_crc": bad, "no_magic": 1} for bad in (3, 5))
    assert rejected([link(rejected=before), link(rejected=after)]) == {"bad_crc": 2}


@pytest.mark.parametrize(("rate", "outcome"), [(14.0, "passed"), (13.9, "failed")])
def test_lowest_allowed_rate(rate: float, outcome: str) -> None:
    rates = EXPECTED_HZ | {"UltrasonicReport": rate}
    links = [link(rates=rates, mono_ns=at_s * NS_PER_S) for at_s in range(11)]
    assert judge_link(links, ON).outcome == outcome
