import pytest

from common.freshness import NS_PER_S
from common.wire import commands as c
from common.wire import framing
from common.wire import reports as r
from common.wire.frame import Side
from sim import trace as t
from sim.requests import Driver, Flood, Freeze, PowerCycle
from sim.simulation import CATCH_UP_NS
from tests.sim.sim_fixture import PORTS, START_NS, SimFixture


def test_velocity_streams_to_both_ports_from_power_on() -> None:
    sim = SimFixture()
    assert len(sim.after(1.0)) == 100
    assert [datagram.port for datagram in sim.datagrams] == [*PORTS] * 50


def test_bad_bytes_are_counted_and_what_follows_is_heard() -> None:
    sim = SimFixture()
    good = framing.pack(c.BumperQuery())
    sim.simulation.receive(b"noise" + good[:3] + good, 4002, sim.now_ns)
    assert len(sim.simulation.take_sent(sim.now_ns)) == 1
    assert sim.simulation.counters["rejected_no_magic"] == 1
    assert sim.simulation.counters["BumperQuery"] == 1


def test_nobody_else_is_obeyed() -> None:
    sim = SimFixture()
    assert sim.say(c.BumperQuery(), c.MotionCommand(c.MotionKind.RUN, 500), port=None) == []
    assert sim.truth.command.kind == "stop"
    assert sim.simulation.counters["foreign"] == 1


def test_a_driver_fault_is_reported_unasked_once_and_to_both_ports() -> None:
    sim = SimFixture()
    sim.do(Driver(side="right", bits=0x80000001))
    sim.do(Driver(side="right", bits=0x80000001))
    report = r.DriverReport(Side.RIGHT, 0x80000001)
    assert sim.after(0.1).count(report) == 2
    assert sim.say(c.DriverQuery(Side.RIGHT), c.DriverQuery(Side.LEFT)) == [
        report,
        r.DriverReport(Side.LEFT, 0),
    ]
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
    assert sim.truth.silent
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
    assert not sim.truth.bumper_brake
    assert [(line.on, line.mono_ns - START_NS) for line in sim.of(t.Power)] == [
        (False, 2 * NS_PER_S),
        (True, 3 * NS_PER_S),
    ]


@pytest.mark.parametrize(
    ("gap_ns", "holes", "driven"), [(CATCH_UP_NS, 0, 0.1), (60 * NS_PER_S, 1, 0.1)]
)
def test_a_late_tick_is_caught_up_and_a_hole_left_out(
    gap_ns: int, holes: int, driven: float
) -> None:
    sim = SimFixture()
    sim.run(1.0)
    sim.simulation.advance(START_NS + gap_ns)
    assert sim.simulation.now_ns == START_NS + gap_ns
    assert sim.simulation.counters["holes"] == holes
    assert driven < sim.truth.x < 1.0


def test_a_flood_comes_to_both_ports_at_its_rate_and_ends() -> None:
    sim = SimFixture()
    sim.do(Flood(seconds=0.1))
    own = 10  # its stream, to both ports
    assert 1800 + own <= len(sim.after(0.1)) <= 2000 + own
    assert {datagram.port for datagram in sim.datagrams} == set(PORTS)
    assert len(sim.after(0.1)) == own
