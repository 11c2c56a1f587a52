"""Summaries of roaming results and their text."""

import math
from dataclasses import replace

import pytest

from common import motion
from common.freshness import NS_PER_S
from sim.trace import Command
from verification.roaming import figures, page
from verification.roaming.conditions import Outage
from verification.roaming.figures import BUMPER, MOTION, REQUESTED, ControlChain, Stream
from verification.roaming.message_log import Entry
from verification.roaming.trial import OutageResult

RUN, STOP, BRAKE = motion.Command

MS = NS_PER_S // 1000
GOOD = Stream(50.0, 0.02, (0.001, 0.002), 0)


def entry(key: str, at_ms: int, seq: int = 1, **rest: int) -> Entry:
    return Entry(key=key, at_ns=at_ms * MS, sent_ns=(at_ms - 2) * MS, seq=seq, **rest)  # type: ignore[arg-type]


def command(at_ms: int, kind: motion.Command = RUN, linear: float = 0.8) -> Command:
    return Command(mono_ns=at_ms * MS, kind=kind, linear=linear, angular=0.0)


def outage(**rest: object) -> OutageResult:
    chain = ControlChain(GOOD, GOOD, (0.001, 0.002), (0.001, 0.002))
    usual = OutageResult(
        stopped_s=0.3, moved_s=0.29, received_s=0.4, drove_s=1.0, presses=1, chain=chain
    )
    return replace(usual, **rest)  # type: ignore[arg-type]


def test_a_stream_has_a_rate_an_age_a_longest_gap_and_losses() -> None:
    entries = [
        entry(BUMPER, 100, 7),
        entry(BUMPER, 400, 8),
        entry(BUMPER, 500, 10),
        entry(MOTION, 600),
    ]
    stream = figures.stream(entries, BUMPER, 0, NS_PER_S)
    assert stream == Stream(3.0, 0.5, (pytest.approx(0.002), pytest.approx(0.002)), 1)  # type: ignore[arg-type]


def test_a_stream_without_messages() -> None:
    stream = figures.stream([], BUMPER, 0, NS_PER_S)
    assert (stream.rate_hz, stream.gap_s, stream.lost) == (0.0, 1.0, 0)
    assert stream.age_s == (math.inf, math.inf)


def test_a_request_is_accepted_with_its_verdict() -> None:
    robot = [entry(MOTION, 100, heard_ns=99 * MS), entry(MOTION, 120), entry(BUMPER, 130)]
    laptop = [entry(REQUESTED, 90), entry(REQUESTED, 140)]
    drive = figures.drive(robot, laptop, [command(100), command(300, STOP, 0.0)], 0, NS_PER_S)
    assert (drive.requested, drive.accepted, drive.stops) == (2, 1, 1)
    assert drive.gap_s == pytest.approx(0.901)


def test_stops_are_transitions() -> None:
    made = [
        command(1),
        command(2, STOP, 0.0),
        command(3, STOP, 0.0),
        command(4),
        command(5, linear=0.0),
    ]
    assert figures.stops(made) == 2
    assert figures.stops(made[1:3]) == 0


def test_ages_of_verdict_and_input() -> None:
    chain = figures.control_chain(
        [entry(MOTION, 100, heard_ns=97 * MS, judged_ns=90 * MS)], 0, NS_PER_S
    )
    assert chain.verdict_s == pytest.approx((0.001, 0.001))
    assert chain.input_s == pytest.approx((0.008, 0.008))
    assert figures.control_chain([], 0, NS_PER_S).verdict_s == (math.inf, math.inf)


@pytest.mark.parametrize(
    ("one", "found"),
    [
        (outage(), []),
        (outage(stopped_s=None), ["it did not stop"]),
        (outage(stopped_s=0.5), ["STOP after 0.50 s, 0.45 s are allowed"]),
        (outage(moved_s=0.6), ["STOP after 0.60 s, 0.45 s are allowed"]),
        (outage(drove_s=None), ["it does not drive again"]),
    ],
)
def test_violations(one: OutageResult, found: list[str]) -> None:
    lost = [(Outage("down for 1 s", 1.0, 1), [one], 0.1)]
    assert page.wrong(lost, 0.35, 0.15) == [f"down for 1 s: {what}" for what in found]


def test_a_short_outage_needs_no_stop_but_no_message_on_board_may_be_lost() -> None:
    short = Outage("down for 0.2 s", 0.2, 1)
    assert page.wrong([(short, [outage(stopped_s=None)], 0.0)], 0.35, 0.15) == []
    chain = replace(outage().chain, bumper=replace(GOOD, lost=3, gap_s=0.3))
    assert page.wrong([(short, [outage(chain=chain)], 0.1)], 0.35, 0.15) == [
        "down for 0.2 s: 3 messages lost on board",
        "down for 0.2 s: no bumper on board for 0.30 s, 0.25 s are allowed",
    ]


def test_a_table_row() -> None:
    lost = [(Outage("down for 1 s", 1.0, 2), [outage(), outage(stopped_s=None, presses=0)], 0.0)]
    assert page.returning(lost).splitlines()[-1] == (
        "| down for 1 s | 2 | 0.30 s, 0.30 s (1) | 0.40 s, 0.40 s | 1.00 s, 1.00 s |"
        " 1 new press 1, drove on 1 |"
    )
