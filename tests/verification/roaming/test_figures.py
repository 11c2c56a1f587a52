"""What notes come to, and what is said of it."""

import math
from dataclasses import replace

import pytest

from common import motion
from common.freshness import NS_PER_S
from sim.trace import Command
from verification.roaming import figures, page
from verification.roaming.conditions import Outage
from verification.roaming.figures import ASKED, BUMPER, MOTION, Chain, Stream
from verification.roaming.notes import Note
from verification.roaming.trial import Back

RUN, STOP, BRAKE = motion.Command

MS = NS_PER_S // 1000
GOOD = Stream(50.0, 0.02, (0.001, 0.002), 0)


def note(key: str, at_ms: int, seq: int = 1, **rest: int) -> Note:
    return Note(key=key, at_ns=at_ms * MS, sent_ns=(at_ms - 2) * MS, seq=seq, **rest)  # type: ignore[arg-type]


def command(at_ms: int, kind: motion.Command = RUN, linear: float = 0.8) -> Command:
    return Command(mono_ns=at_ms * MS, kind=kind, linear=linear, angular=0.0)


def back(**rest: object) -> Back:
    chain = Chain(GOOD, GOOD, (0.001, 0.002), (0.001, 0.002))
    usual = Back(told_s=0.3, moved_s=0.29, heard_s=0.4, drove_s=1.0, hands=1, chain=chain)
    return replace(usual, **rest)  # type: ignore[arg-type]


def test_a_stream_has_a_rate_an_age_a_longest_gap_and_losses() -> None:
    notes = [note(BUMPER, 100, 7), note(BUMPER, 400, 8), note(BUMPER, 500, 10), note(MOTION, 600)]
    stream = figures.stream(notes, BUMPER, 0, NS_PER_S)
    assert stream == Stream(3.0, 0.5, (pytest.approx(0.002), pytest.approx(0.002)), 1)  # type: ignore[arg-type]


def test_a_stream_that_did_not_come_is_never_there() -> None:
    stream = figures.stream([], BUMPER, 0, NS_PER_S)
    assert (stream.rate_hz, stream.gap_s, stream.lost) == (0.0, 1.0, 0)
    assert stream.age_s == (math.inf, math.inf)


def test_a_request_counts_once_its_verdict_tells_of_it() -> None:
    robot = [note(MOTION, 100, heard_ns=99 * MS), note(MOTION, 120), note(BUMPER, 130)]
    laptop = [note(ASKED, 90), note(ASKED, 140)]
    drive = figures.drive(robot, laptop, [command(100), command(300, STOP, 0.0)], 0, NS_PER_S)
    assert (drive.asked, drive.taken, drive.stops) == (2, 1, 1)
    assert drive.gap_s == pytest.approx(0.901)


def test_stopping_twice_is_two_stops_and_standing_is_none() -> None:
    made = [
        command(1),
        command(2, STOP, 0.0),
        command(3, STOP, 0.0),
        command(4),
        command(5, linear=0.0),
    ]
    assert figures.stops(made) == 2
    assert figures.stops(made[1:3]) == 0


def test_a_verdict_and_its_input_have_an_age() -> None:
    chain = figures.chain([note(MOTION, 100, heard_ns=97 * MS, judged_ns=90 * MS)], 0, NS_PER_S)
    assert chain.verdict_s == pytest.approx((0.001, 0.001))
    assert chain.input_s == pytest.approx((0.008, 0.008))
    assert figures.chain([], 0, NS_PER_S).verdict_s == (math.inf, math.inf)


@pytest.mark.parametrize(
    ("one", "found"),
    [
        (back(), []),
        (back(told_s=None), ["it did not stop"]),
        (back(told_s=0.5), ["STOP after 0.50 s, 0.45 s are allowed"]),
        (back(moved_s=0.6), ["STOP after 0.60 s, 0.45 s are allowed"]),
        (back(drove_s=None), ["it would not drive again"]),
    ],
)
def test_what_is_not_as_it_should_be(one: Back, found: list[str]) -> None:
    lost = [(Outage("down for 1 s", 1.0, 1), [one], 0.1)]
    assert page.wrong(lost, 0.35, 0.15) == [f"down for 1 s: {what}" for what in found]


def test_a_short_loss_may_be_driven_over_and_the_robots_own_messages_may_not_be_lost() -> None:
    short = Outage("down for 0.2 s", 0.2, 1)
    assert page.wrong([(short, [back(told_s=None)], 0.0)], 0.35, 0.15) == []
    chain = replace(back().chain, bumper=replace(GOOD, lost=3, gap_s=0.3))
    assert page.wrong([(short, [back(chain=chain)], 0.1)], 0.35, 0.15) == [
        "down for 0.2 s: 3 messages lost on board",
        "down for 0.2 s: no bumper on board for 0.30 s, 0.25 s are allowed",
    ]


def test_a_row_for_people() -> None:
    lost = [(Outage("down for 1 s", 1.0, 2), [back(), back(told_s=None, hands=0)], 0.0)]
    assert page.returning(lost).splitlines()[-1] == (
        "| down for 1 s | 2 | 0.30 s, 0.30 s (1) | 0.40 s, 0.40 s | 1.00 s, 1.00 s |"
        " 1 new press 1, drove on 1 |"
    )
