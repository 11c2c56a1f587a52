"""The watchdog test in simulated time: boards with and without a watchdog, silent and fast ones."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import pytest

from cli.commission.watchdog_plan import (
    BRAKE,
    LINEAR_MPS,
    PERIOD_NS,
    RUN,
    SILENT_NS,
    WatchdogPlan,
    judge_watchdog,
)
from common.freshness import NS_PER_S, Latest
from common.motion import Twist
from common.wire.commands import MotionCommand, MotionKind

START_NS = 50 * NS_PER_S
STEP_NS = NS_PER_S // 100
Sent = list[tuple[int, MotionCommand]]
Board = Callable[[int, Sent], float | None]  # the speed at a time, None while the board is silent


def since_s(now_ns: int, sent: Sent, kind: MotionKind) -> float:
    times = [at for at, command in sent if command.kind is kind]
    return (now_ns - times[-1]) / NS_PER_S if times else float("inf")


def driven_on(now_ns: int, sent: Sent) -> float:
    if not sent or sent[-1][1] == BRAKE:
        return 0.0
    return LINEAR_MPS


def watched(limit_s: float) -> Board:
    def board(now_ns: int, sent: Sent) -> float:
        return driven_on(now_ns, sent) * (since_s(now_ns, sent, MotionKind.RUN) < limit_s)

    return board


def played(board: Board, limit_s: float = 5.0) -> tuple[WatchdogPlan, Sent]:
    plan, sent, now_ns = WatchdogPlan(START_NS), Sent(), START_NS
    while plan.phase != "over" and now_ns < START_NS + limit_s * NS_PER_S:
        plan, command = plan.tick(now_ns)
        if command is not None:
            sent.append((now_ns, command))
        speed = board(now_ns, sent)
        if speed is not None:
            plan = plan.add(Latest(Twist(speed), now_ns))
        now_ns += STEP_NS
    return plan, sent


def test_a_board_without_a_watchdog_drives_on_and_is_braked() -> None:
    plan, sent = played(driven_on)
    verdict = judge_watchdog(plan)
    assert (plan.phase, verdict.outcome) == ("over", "passed")
    assert verdict.text == "Drives on for 1 s without a command: no watchdog."
    runs = [at for at, command in sent if command == RUN]
    brakes = [at for at, command in sent if command == BRAKE]
    assert runs == [START_NS + i * PERIOD_NS for i in range(20)]
    assert brakes[0] - runs[-1] == NS_PER_S
    assert {b - a for a, b in pairwise(brakes)} == {PERIOD_NS}
    assert len(runs) + len(brakes) == len(sent)


@pytest.mark.parametrize("limit_s", [0.1, 0.5, 0.75])
def test_a_board_with_a_watchdog_stops_and_ends_the_silence(limit_s: float) -> None:
    plan, sent = played(watched(limit_s))
    verdict = judge_watchdog(plan)
    assert verdict.outcome == "passed"
    assert f"Stops by itself after {limit_s:.2f} s" in verdict.text
    first_brake = next(at for at, command in sent if command == BRAKE)
    last_run = max(at for at, command in sent if command == RUN)
    assert (first_brake - last_run) / NS_PER_S == pytest.approx(limit_s + 0.21, abs=0.011)
    assert plan.phase == "over"


def test_deceleration_is_distinguished_from_standstill() -> None:
    def board(now_ns: int, sent: Sent) -> float:
        late_s = since_s(now_ns, sent, MotionKind.RUN) - 0.2
        return max(0.0, driven_on(now_ns, sent) - max(0.0, late_s) * 0.1)

    verdict = judge_watchdog(played(board)[0])
    assert verdict.text == "Stops by itself after 0.51 s, slowing down from 0.36 s on."


def half_way(now_ns: int, sent: Sent) -> float:
    late_s = since_s(now_ns, sent, MotionKind.RUN)
    return driven_on(now_ns, sent) * (0.5 if late_s > 0.5 else 1.0)


@pytest.mark.parametrize(
    ("board", "phrase"),
    [
        (lambda now_ns, sent: 0.0, "The wheels did not turn at the end of RUN"),
        (lambda now_ns, sent: None, "was silent for 0.2 s."),
        (lambda now_ns, sent: 0.21 if sent[-1][1] == RUN else 0.0, "It moved at 0.21 m/s"),
        (half_way, "It slowed down but did not stand"),
    ],
)
def test_inconclusive_results_fail(board: Board, phrase: str) -> None:
    verdict = judge_watchdog(played(board)[0])
    assert verdict.outcome == "failed"
    assert phrase in verdict.text


def test_a_board_that_falls_silent_in_the_silence_is_braked_at_once() -> None:
    def board(now_ns: int, sent: Sent) -> float | None:
        hidden = since_s(now_ns, sent, MotionKind.RUN) > 0.3 and sent[-1][1] == RUN
        return None if hidden else driven_on(now_ns, sent)

    plan, sent = played(board)
    first_brake = next(at for at, command in sent if command == BRAKE)
    assert (
        first_brake - (START_NS + NS_PER_S - PERIOD_NS) <= 0.3 * NS_PER_S + SILENT_NS + 2 * STEP_NS
    )
    assert judge_watchdog(plan).outcome == "failed"
    assert plan.phase == "over"


def test_it_brakes_until_standstill() -> None:
    plan, sent = played(lambda now_ns, sent: LINEAR_MPS)
    assert plan.phase == "brake"
    assert sent[-1][1] == BRAKE
    assert sent[-1][0] > START_NS + 4.9 * NS_PER_S
    assert (
        judge_watchdog(plan).outcome == "passed"
    )  # the watchdog's verdict is known; the shell reports the missing standstill


def test_a_board_that_is_silent_while_braked_never_counts_as_standing() -> None:
    def board(now_ns: int, sent: Sent) -> float | None:
        return None if sent[-1][1] == BRAKE else LINEAR_MPS

    assert played(board)[0].phase == "brake"
    assert (
        replace(WatchdogPlan(START_NS), phase="brake").tick(START_NS + NS_PER_S)[0].phase == "brake"
    )


@pytest.mark.parametrize("phase", ["run", "silence"])
def test_an_abort_brakes_with_the_next_tick(phase: str) -> None:
    plan = replace(WatchdogPlan(START_NS, sent_ns=START_NS), phase=phase)  # type: ignore[arg-type]
    ended, command = plan.end("Ctrl-C", START_NS + 1).tick(START_NS + 2)
    assert (ended.phase, command) == ("brake", BRAKE)
    assert ended.end("again", START_NS + 3) == ended
    assert judge_watchdog(ended).text == "Ended early: Ctrl-C"


def test_a_silence_without_a_sample_is_inconclusive() -> None:
    plan = WatchdogPlan(START_NS, "over", last_run_ns=START_NS, braked_ns=START_NS + NS_PER_S)
    silent = plan.add(Latest(Twist(LINEAR_MPS), START_NS))
    assert "No velocity was received in the silence" in judge_watchdog(silent).text


def test_standstill_from_the_first_sample() -> None:
    plan = WatchdogPlan(START_NS, "over", last_run_ns=START_NS, braked_ns=START_NS + NS_PER_S)
    for speed, after_ns in ((LINEAR_MPS, 0), (0.0, NS_PER_S // 10), (0.0, NS_PER_S // 2)):
        plan = plan.add(Latest(Twist(speed), START_NS + after_ns))
    assert judge_watchdog(plan).text == (
        "Stops by itself after 0.10 s, slowing down from 0.10 s on."
    )
