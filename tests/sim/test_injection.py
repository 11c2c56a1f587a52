import math
from typing import Any

import msgspec
import pytest

from common.freshness import NS_PER_S
from common.motion import Command
from common.wire import commands as c
from common.wire import reports as r
from sim import requests as q
from sim.trace import Disturbed
from tests.sim.sim_fixture import START_NS, SimFixture, room

BOX: dict[str, Any] = {"name": "crate", "x": 3.0, "y": 0.0, "length": 1.0, "width": 1.0}
CRATE = room(BOX).boxes[0]


def test_the_bumper_is_pressed_and_let_go_by_hand() -> None:
    sim = SimFixture()
    assert sim.do(q.Bumper(pressed=True)).ok
    assert (sim.truth.pressed, sim.truth.contact) == (True, False)
    assert sim.say(c.BumperQuery()) == [r.BumperReport(True)]
    sim.do(q.Bumper(pressed=False))
    assert sim.say(c.BumperQuery()) == [r.BumperReport(False)]


def test_a_hand_does_not_lift_the_bumper_off_an_obstacle() -> None:
    sim = SimFixture(room(BOX))
    sim.do(q.Place(x=2.5 - 0.55 - 0.001, y=0.0))
    sim.do(q.Bumper(pressed=False))
    assert sim.truth.pressed


def test_a_sonar_is_disturbed() -> None:
    sim = SimFixture()
    sim.do(q.Sonar(name="rear", range=0.5))
    sim.after(0.05)
    (ranges,) = sim.say(c.UltrasonicQuery())
    assert isinstance(ranges, r.UltrasonicReport)
    assert ranges.ranges_mm[6] == 500


@pytest.mark.parametrize(
    ("direction", "to_pc", "to_board"),
    [("to_pc", 1.0, 0.0), ("to_board", 0.0, 1.0), ("both", 1.0, 1.0)],
)
def test_the_cable_is_disturbed_one_way_or_both(
    direction: str, to_pc: float, to_board: float
) -> None:
    sim = SimFixture()
    sim.do(msgspec.convert({"do": "wire", "direction": direction, "drop": 1.0}, q.Wire))
    assert sim.simulation.to_pc.faults.drop == to_pc
    assert sim.simulation.to_board.faults.drop == to_board


def test_it_is_placed_and_stands_there() -> None:
    sim = SimFixture()
    sim.run(1.0)
    sim.after(1.0)
    sim.stop()
    assert sim.do(q.Place(x=-3.0, y=2.0, heading=math.pi)).ok
    assert (sim.truth.x, sim.truth.y, sim.truth.linear) == (-3.0, 2.0, 0.0)


def test_it_is_not_placed_into_something() -> None:
    sim = SimFixture(room(BOX))
    reply = sim.do(q.Place(x=3.0, y=0.0))
    assert (reply.ok, reply.error) == (False, "an obstacle is at x 3, y 0")
    assert sim.truth.x == 0.0


def test_boxes_come_and_go() -> None:
    sim = SimFixture()
    assert sim.do(q.AddBox(box=CRATE)).ok
    assert sim.truth.clearance == pytest.approx(2.5 - 0.55)
    assert sim.do(q.RemoveBox(name="crate")).ok
    assert sim.truth.clearance is None


def test_a_box_put_beside_the_vehicle_presses_the_bumper_at_once() -> None:
    sim = SimFixture()
    sim.do(q.AddBox(box=msgspec.structs.replace(CRATE, x=0.55 + 0.5 + 0.001)))
    assert sim.say(c.BumperQuery()) == [r.BumperReport(True)]


def test_a_box_is_not_put_onto_the_vehicle() -> None:
    sim = SimFixture()
    reply = sim.do(q.AddBox(box=msgspec.structs.replace(CRATE, x=0.5)))
    assert (reply.ok, reply.error) == (False, "an obstacle would overlap the vehicle")
    assert sim.simulation.world.boxes == ()


@pytest.mark.parametrize(
    ("plan", "known"), [(room(), "there are: none"), (room(BOX), "there are: crate")]
)
def test_a_box_that_is_not_there_cannot_be_removed(plan: Any, known: str) -> None:
    reply = SimFixture(plan).do(q.RemoveBox(name="crane"))
    assert reply.error == f"no box is called 'crane'; {known}"


def test_the_truth_is_told_and_leaves_no_line() -> None:
    sim = SimFixture()
    assert sim.do(q.GetTruth()).truth == sim.truth
    assert sim.records == []


def test_what_is_asked_for_is_traced_with_its_error() -> None:
    sim = SimFixture(room(BOX))
    sim.do(q.Place(x=3.0, y=0.0))
    (line,) = sim.of(Disturbed)
    assert msgspec.to_builtins(line) == {
        "event": "fault",
        "mono_ns": START_NS,
        "request": {"do": "place", "x": 3.0, "y": 0.0, "heading": 0.0},
        "error": "an obstacle is at x 3, y 0",
    }


def test_a_script_happens_in_order_and_in_time() -> None:
    steps = (
        q.Step(at=1.0, request=q.Bumper(pressed=False)),
        q.Step(at=0.5, request=q.Bumper(pressed=True)),
        q.Step(at=0.505, request=q.Freeze(seconds=0.1)),
    )
    sim = SimFixture(script=q.Script(steps=steps))
    sim.after(0.4)
    assert sim.of(Disturbed) == []
    sim.after(1.0)
    assert [(line.request, line.mono_ns - START_NS) for line in sim.of(Disturbed)] == [
        (q.Bumper(pressed=True), NS_PER_S // 2),
        (q.Freeze(seconds=0.1), round(0.505 * NS_PER_S)),
        (q.Bumper(pressed=False), NS_PER_S),
    ]


def test_a_script_is_in_time_though_the_tick_is_late() -> None:
    sim = SimFixture(script=q.Script(steps=(q.Step(at=0.1, request=q.Freeze(seconds=0.1)),)))
    sim.injection.advance(START_NS + NS_PER_S // 2)
    assert sim.simulation.now_ns == START_NS + NS_PER_S // 2
    frozen = 4  # at 0.12, 0.14, 0.16 and 0.18 s
    assert len(sim.simulation.take_sent(sim.now_ns + NS_PER_S)) == 2 * (25 - frozen)


@pytest.mark.parametrize(
    ("where", "ports"),
    [("asked", [4001]), ("first", [4002]), ("second", [4001]), ("both", [4002, 4001])],
)
def test_answers_go_where_the_firmware_sends_them(where: q.Where, ports: list[int]) -> None:
    sim = SimFixture()
    sim.do(q.Firmware(answers=where))
    before = len(sim.datagrams)
    sim.say(c.BumperQuery(), port=4001)
    assert [datagram.port for datagram in sim.datagrams[before:]] == ports


def test_hits_may_be_reported_on_the_other_port() -> None:
    sim = SimFixture()
    sim.do(q.Firmware(hits="second"))
    for pressed, port in ((False, 4002), (True, 4001)):
        sim.do(q.Bumper(pressed=pressed))
        before = len(sim.datagrams)
        assert sim.say(c.BumperQuery()) == [r.BumperReport(pressed)]
        assert [datagram.port for datagram in sim.datagrams[before:]] == [port]


def test_a_firmware_without_echoes_sets_its_brakes_and_says_nothing() -> None:
    sim = SimFixture()
    sim.do(q.Firmware(echoes=False))
    assert sim.say(c.BumperBrakeSet(True), c.UltrasonicBrakeSet(True)) == []
    assert (sim.truth.bumper_brake, sim.truth.ultrasonic_brake) == (True, True)


def test_a_board_that_ignores_stop_drives_on_and_obeys_break() -> None:
    sim = SimFixture()
    sim.run(0.3)
    sim.after(1.0)
    sim.do(q.Firmware(ignores=(Command.STOP,)))
    sim.stop()
    sim.after(1.0)
    assert sim.truth.linear == pytest.approx(0.3)
    assert sim.truth.command.kind == "stop"
    sim.say(c.MotionCommand(c.MotionKind.BREAK))
    sim.after(0.1)
    assert sim.truth.linear == 0.0


def test_every_third_report_of_a_kind_is_lost() -> None:
    sim = SimFixture()
    sim.do(q.Lose(reports=("bumper",), every=3))
    counts = [len(sim.say(c.BumperQuery())) for _ in range(9)]
    assert counts == [1, 1, 0] * 3
    assert [len(sim.say(c.DistanceQuery())) for _ in range(3)] == [1, 1, 1]
    sim.do(q.Lose())
    assert [len(sim.say(c.BumperQuery())) for _ in range(3)] == [1, 1, 1]
