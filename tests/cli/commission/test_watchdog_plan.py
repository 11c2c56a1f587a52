"""The watchdog's trial, in simulated time: boards with and without one, deaf ones, wild ones."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import pytest

from cli.commission.watchdog_plan import (
    BREAK,
    DEAF_NS,
    LINEAR_MPS,
    PERIOD_NS,
    RUN,
    Sample,
    Trial,
    judge_trial,
)
from common.freshness import NS_PER_S
from common.wire.commands import MotionCommand, MotionKind

START_NS = 50 * NS_PER_S
STEP_NS = NS_PER_S // 100
Sent = list[tuple[int, MotionCommand]]
Board = Callable[[int, Sent], float | None]  # the speed at a time, None while it is silent


def since_s(now_ns: int, sent: Sent, kind: MotionKind) -> float:
    times = [at for at, command in sent if command.kind is kind]
    return (now_ns - times[-1]) / NS_PER_S if times else float("inf")


def driven_on(now_ns: int, sent: Sent) -> float:
    if not sent or sent[-1][1] == BREAK:
        return 0.0
    return LINEAR_MPS


def watched(limit_s: float) -> Board:
    def board(now_ns: int, sent: Sent) -> float:
        return driven_on(now_ns, sent) * (since_s(now_ns, sent, MotionKind.RUN) < limit_s)

    return board


def played(board: Board, limit_s: float = 5.0) -> tuple[Trial, Sent]:
    trial, sent, now_ns = Trial(START_NS), Sent(), START_NS
    while trial.phase != "over" and now_ns < START_NS + limit_s * NS_PER_S:
        trial, command = trial.tick(now_ns)
        if command is not None:
            sent.append((now_ns, command))
        speed = board(now_ns, sent)
        if speed is not None:
            trial = trial.hear(Sample(speed, 0.0, now_ns))
        now_ns += STEP_NS
    return trial, sent


def test_a_board_without_one_drives_on_and_is_braked() -> None:
    trial, sent = played(driven_on)
    verdict = judge_trial(trial)
    assert (trial.phase, verdict.outcome) == ("over", "passed")
    assert verdict.text == "Drives on for 1 s without a command: no watchdog."
    runs = [at for at, command in sent if command == RUN]
    brakes = [at for at, command in sent if command == BREAK]
    assert runs == [START_NS + i * PERIOD_NS for i in range(20)]
    assert brakes[0] - runs[-1] == NS_PER_S
    assert {b - a for a, b in pairwise(brakes)} == {PERIOD_NS}
    assert len(runs) + len(brakes) == len(sent)


@pytest.mark.parametrize("limit_s", [0.1, 0.5, 0.75])
def test_a_board_with_one_stops_by_itself_and_that_ends_the_silence(limit_s: float) -> None:
    trial, sent = played(watched(limit_s))
    verdict = judge_trial(trial)
    assert verdict.outcome == "passed"
    assert f"Stops by itself after {limit_s:.2f} s" in verdict.text
    first_brake = next(at for at, command in sent if command == BREAK)
    last_run = max(at for at, command in sent if command == RUN)
    assert (first_brake - last_run) / NS_PER_S == pytest.approx(limit_s + 0.21, abs=0.011)
    assert trial.phase == "over"


def test_slowing_down_is_told_from_standing() -> None:
    def board(now_ns: int, sent: Sent) -> float:
        late_s = since_s(now_ns, sent, MotionKind.RUN) - 0.2
        return max(0.0, driven_on(now_ns, sent) - max(0.0, late_s) * 0.1)

    verdict = judge_trial(played(board)[0])
    assert verdict.text == "Stops by itself after 0.51 s, slowing down from 0.36 s on."


def half_way(now_ns: int, sent: Sent) -> float:
    late_s = since_s(now_ns, sent, MotionKind.RUN)
    return driven_on(now_ns, sent) * (0.5 if late_s > 0.5 else 1.0)


@pytest.mark.parametrize(
    ("board", "said"),
    [
        (lambda now_ns, sent: 0.0, "The wheels did not turn at the end of RUN"),
        (lambda now_ns, sent: None, "was not heard for 0.2 s."),
        (lambda now_ns, sent: 0.21 if sent[-1][1] == RUN else 0.0, "It moved at 0.21 m/s"),
        (half_way, "It slowed down but did not stand"),
    ],
)
def test_what_tells_nothing_fails(board: Board, said: str) -> None:
    verdict = judge_trial(played(board)[0])
    assert verdict.outcome == "failed"
    assert said in verdict.text


def test_a_board_that_falls_silent_in_the_silence_is_braked_at_once() -> None:
    def board(now_ns: int, sent: Sent) -> float | None:
        hidden = since_s(now_ns, sent, MotionKind.RUN) > 0.3 and sent[-1][1] == RUN
        return None if hidden else driven_on(now_ns, sent)

    trial, sent = played(board)
    first_brake = next(at for at, command in sent if command == BREAK)
    assert first_brake - (START_NS + NS_PER_S - PERIOD_NS) <= 0.3 * NS_PER_S + DEAF_NS + 2 * STEP_NS
    assert judge_trial(trial).outcome == "failed"
    assert trial.phase == "over"


def test_it_brakes_until_the_vehicle_stands_and_says_so() -> None:
    trial, sent = played(lambda now_ns, sent: LINEAR_MPS)
    assert trial.phase == "brake"
    assert sent[-1][1] == BREAK
    assert sent[-1][0] > START_NS + 4.9 * NS_PER_S
    assert (
        judge_trial(trial).outcome == "passed"
    )  # what was asked is known; the shell says the rest


def test_a_board_that_is_silent_while_braked_never_counts_as_standing() -> None:
    def board(now_ns: int, sent: Sent) -> float | None:
        return None if sent[-1][1] == BREAK else LINEAR_MPS

    assert played(board)[0].phase == "brake"
    assert replace(Trial(START_NS), phase="brake").tick(START_NS + NS_PER_S)[0].phase == "brake"


@pytest.mark.parametrize("phase", ["run", "silence"])
def test_an_end_from_outside_brakes_with_the_next_tick(phase: str) -> None:
    trial = replace(Trial(START_NS, sent_ns=START_NS), phase=phase)  # type: ignore[arg-type]
    ended, command = trial.end("ctrl-c", START_NS + 1).tick(START_NS + 2)
    assert (ended.phase, command) == ("brake", BREAK)
    assert ended.end("again", START_NS + 3) == ended
    assert judge_trial(ended).text == "Ended early: ctrl-c"


def test_a_silence_without_a_sample_tells_nothing() -> None:
    trial = Trial(START_NS, "over", last_run_ns=START_NS, broken_ns=START_NS + NS_PER_S)
    heard = trial.hear(Sample(LINEAR_MPS, 0.0, START_NS))
    assert "No velocity was heard in the silence" in judge_trial(heard).text


def test_who_stands_from_the_first_sample_stands_from_there() -> None:
    trial = Trial(START_NS, "over", last_run_ns=START_NS, broken_ns=START_NS + NS_PER_S)
    for speed, after_ns in ((LINEAR_MPS, 0), (0.0, NS_PER_S // 10), (0.0, NS_PER_S // 2)):
        trial = trial.hear(Sample(speed, 0.0, START_NS + after_ns))
    assert judge_trial(trial).text == ("Stops by itself after 0.10 s, slowing down from 0.10 s on.")
