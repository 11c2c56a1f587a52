import math

import msgspec
import pytest

from common.freshness import NS_PER_S
from common.wire import commands as c
from common.wire import framing
from common.wire import reports as r
from common.wire.frame import Side
from sim import trace as t
from sim.requests import Driver, Flood, Freeze, Person, Place, PowerCycle, Wire
from sim.simulation import CATCH_UP_NS
from tests.sim.sim_fixture import PORTS, START_NS, SimFixture, room


def test_bad_bytes_are_counted_and_what_follows_is_heard() -> None:
    sim = SimFixture()
    good = framing.pack(c.BumperQuery())
    sim.simulation.receive(b"noise" + good[:3] + good, 4002, sim.now_ns)
    assert len(sim.simulation.take_sent(sim.now_ns)) == 1
    assert sim.simulation.counters["rejected_no_magic"] == 1
    assert sim.simulation.counters["BumperQuery"] == 1


def test_a_driver_fault_is_reported_unasked_once_and_to_both_ports() -> None:
    sim = SimFixture()
    for _ in range(2):
        sim.do(Driver(side="right", bits=0x80000001))
    assert sim.after(0.1).count(r.DriverReport(Side.RIGHT, 0x80000001)) == 2
    sim.do(Driver(side="right", bits=0))
    assert not any(isinstance(frame, r.DriverReport) for frame in sim.after(0.1))


def test_a_frozen_board_neither_speaks_nor_hears_and_drives_on() -> None:
    sim = SimFixture()
    sim.run(0.5)
    sim.after(1.0)
    sim.do(Freeze(seconds=0.5))
    sim.do(Driver(side="left", bits=1))
    sim.stop()
    assert sim.after(0.49) == []
    assert sim.simulation.counters["unheard"] == 1
    assert (sim.truth.linear, sim.truth.command.kind) == (0.5, "run")
    assert r.VelocityReport(500, 0) in sim.after(0.1)


def test_a_power_cycle_stops_it_and_clears_counters_and_switches() -> None:
    sim = SimFixture()
    sim.say(c.BumperBrakeSet(True))
    sim.run(0.5)
    sim.after(2.0)
    sim.do(PowerCycle(seconds=1.0))
    assert sim.after(0.99) == []
    assert (sim.truth.linear, sim.truth.command.kind) == (0.0, "stop")
    assert sim.after(0.1)
    assert sim.say(c.DistanceQuery()) == [r.DistanceReport(0, 0)]
    assert not sim.simulation.board.bumper_brake
    assert [(line.on, line.mono_ns - START_NS) for line in sim.of(t.Power)] == [
        (False, 2 * NS_PER_S),
        (True, 3 * NS_PER_S),
    ]


@pytest.mark.parametrize(("gap_ns", "holes"), [(CATCH_UP_NS, 0), (60 * NS_PER_S, 1)])
def test_a_late_tick_is_caught_up_and_a_hole_left_out(gap_ns: int, holes: int) -> None:
    sim = SimFixture()
    sim.run(1.0)
    sim.simulation.advance(START_NS + gap_ns)
    assert sim.simulation.now_ns == START_NS + gap_ns
    assert sim.simulation.counters["holes"] == holes
    assert 0.1 < sim.truth.x < 1.0


def test_a_flood_comes_to_both_ports_at_its_rate_and_ends() -> None:
    sim = SimFixture()
    sim.do(Flood(seconds=0.1))
    own = 10  # its stream, to both ports
    assert 1800 + own <= len(sim.after(0.1)) <= 2000 + own
    assert {datagram.port for datagram in sim.datagrams} == set(PORTS)
    assert len(sim.after(0.1)) == own
    sim.datagrams.clear()
    sim.do(Flood(seconds=0.1, rate=200, datagram=b"GS" * 1024))
    sim.after(0.1)
    payloads = [datagram.payload for datagram in sim.datagrams]
    assert 18 <= payloads.count(b"GS" * 1024) <= 20


@pytest.mark.parametrize(
    ("direction", "to_pc", "to_board"),
    [("to_pc", 1.0, 0.0), ("to_board", 0.0, 1.0), ("both", 1.0, 1.0)],
)
def test_the_cable_is_disturbed_one_way_or_both(
    direction: str, to_pc: float, to_board: float
) -> None:
    sim = SimFixture()
    sim.do(msgspec.convert({"do": "wire", "direction": direction, "drop": 1.0}, Wire))
    assert sim.simulation.to_pc.faults.drop == to_pc
    assert sim.simulation.to_board.faults.drop == to_board


def test_it_is_placed_where_there_is_room() -> None:
    box = {"name": "crate", "x": 3.0, "y": 0.0, "length": 1.0, "width": 1.0}
    sim = SimFixture(room(box))
    sim.run(1.0)
    sim.after(0.5)
    refused = "an obstacle is at x 3, y 0"
    assert sim.do(Place(x=3.0, y=0.0)).error == refused
    assert sim.truth.x == pytest.approx(0.15, abs=0.01)
    assert sim.truth.linear == pytest.approx(0.6)
    assert sim.do(Place(x=-3.0, y=2.0, heading=math.pi)).ok
    assert (sim.truth.x, sim.truth.y, sim.truth.linear) == (-3.0, 2.0, 0.0)
    assert [line.error for line in sim.of(t.Disturbed)] == [refused, ""]


def test_an_incomplete_last_line_is_ignored() -> None:
    line = msgspec.json.encode(t.BumperSent(mono_ns=1, pressed=True)) + b"\n"
    assert t.read(line + b'{"event":"tru') == [t.BumperSent(mono_ns=1, pressed=True)]


def test_a_person_walks_across_waits_before_the_vehicle_and_is_gone() -> None:
    sim = SimFixture()
    sim.do(Person(x=0.0, y=2.0, heading=-math.pi / 2, speed=1.0, seconds=4.0))
    sim.after(1.0)
    assert sim.truth.clearance == pytest.approx(0.45, abs=0.06)  # 1.0 less half of each body
    sim.after(2.0)
    assert sim.truth.clearance == pytest.approx(0.12, abs=0.03)
    assert not sim.truth.contact
    assert sim.do(Person(x=0.3, y=0.0, seconds=1.0)).error == "the vehicle is at x 0.3, y 0"
    sim.after(1.5)
    assert sim.truth.clearance is None
