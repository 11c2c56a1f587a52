"""Calls of operators, lost polls and uncommanded motion, through the entries of the core."""

import pytest
from msgspec import Struct

from common import messages as m
from common.freshness import NS_PER_S
from common.wire import commands, reports
from common.wire.commands import MotionKind
from services.bridge.output import Answer, Output
from tests.bridge.core_fixture import HIT, MS, Bench, events, frames, motions, published
from tests.factories import safety_state


class Caller:
    """Records what it is answered."""

    def __init__(self) -> None:
        self.replies: list[Struct] = []
        self.refusals: list[str] = []

    def reply(self, reply: Struct) -> None:
        self.replies.append(reply)

    def refuse(self, reason: str) -> None:
        self.refusals.append(reason)


def give(*outs: Output) -> None:
    """Give the answers as the shell does."""
    for out in outs:
        for answer in out.answers:
            assert isinstance(answer, Answer)
            answer.give()


@pytest.fixture
def caller() -> Caller:
    return Caller()


LAMP = m.LedRequest(channel=0, mode=1)


@pytest.mark.parametrize("done", [True, False])
def test_a_lamp_is_answered_by_the_boards_echo(bench: Bench, caller: Caller, done: bool) -> None:
    bench.arm()
    out = bench.core.led(LAMP, caller, bench.now_ns)
    (frame,) = frames(out)
    assert isinstance(frame, commands.LedSet)
    give(out, bench.answer(reports.LedReport(done)), bench.answer(reports.LedReport(done)))
    assert len(caller.replies) == done
    assert caller.refusals == ([] if done else ["the board reports a failure (0xAA)"])


def test_a_second_lamp_call_and_an_absent_board_are_refused(bench: Bench, caller: Caller) -> None:
    give(bench.core.led(LAMP, caller, bench.now_ns))
    assert "the board is absent" in caller.refusals.pop()
    bench.arm()
    bench.core.led(LAMP, Caller(), bench.now_ns)
    give(bench.core.led(LAMP, caller, bench.now_ns))
    assert caller.refusals == ["another call for the lamps is pending"]


def test_calls_without_an_echo_are_refused_in_time(bench: Bench, caller: Caller) -> None:
    bench.arm()
    bench.core.operator.on_safety(safety_state(heartbeat=1), bench.now_ns)
    request = m.SwitchesRequest(ultrasonic_brake=False, echo=1)
    give(bench.core.switches(request, caller, bench.now_ns))
    give(bench.core.led(LAMP, caller, bench.now_ns))
    assert caller.refusals == []
    for _ in range(300):
        bench.receive(HIT)  # the board stays connected
        give(bench.tick())
    assert len(caller.refusals) == 2
    assert all("did not echo within" in text for text in caller.refusals)


def test_switches_are_answered_by_the_boards_echo(bench: Bench, caller: Caller) -> None:
    bench.arm()
    give(bench.core.switches(m.SwitchesRequest(bumper_brake=False), caller, bench.now_ns))
    assert len(caller.refusals) == 1  # no echo of safety's heartbeat
    bench.core.operator.on_safety(safety_state(heartbeat=7), bench.now_ns)
    request = m.SwitchesRequest(bumper_brake=False, echo=7)
    give(bench.core.switches(request, caller, bench.now_ns), bench.tick())
    bench.answer(reports.BumperBrakeReport(False))
    give(bench.tick())
    assert caller.replies == [m.Switches(ultrasonic_brake=True, bumper_brake=False)]


def test_lost_polls_are_counted_each_second(bench: Bench) -> None:
    bench.arm()
    for _ in range(100):
        bench.tick()
    published(bench.core.second(), "switches")
    assert bench.counters["missed_bumper"] > 0


def test_motion_without_a_command_brakes_and_is_an_event(bench: Bench) -> None:
    outs = [bench.tick()]
    for speed in (0, 0, *[100] * 80):
        outs.append(bench.answer(reports.VelocityReport(speed, 0)))
        outs.append(bench.tick(20 * MS))
    assert sum(events(out).count("uncommanded_motion") for out in outs) == 1
    assert MotionKind.BREAK in [kind for out in outs for kind in motions(out)]
    assert bench.now_ns < 2_000 * NS_PER_S
