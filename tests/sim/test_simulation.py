import math
from typing import Any

import msgspec
import pytest

from common.freshness import NS_PER_S
from common.wire import commands as c
from common.wire import framing
from common.wire import reports as r
from common.wire.frame import Side
from sim import trace as t
from sim.requests import Asked, Driver, Flood, Freeze, GetTruth, Place, PowerCycle, Wire
from sim.simulation import CATCH_UP_NS
from tests.sim.sim_fixture import PORTS, START_NS, WALL_AHEAD, SimFixture, model, room


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


def test_a_flood_of_another_datagram() -> None:
    sim = SimFixture()
    sim.do(Flood(seconds=0.1, rate=200, datagram=b"GS" * 1024))
    sim.after(0.1)
    payloads = [datagram.payload for datagram in sim.datagrams]
    assert 18 <= payloads.count(b"GS" * 1024) <= 20


# --- requests ---------------------------------------------------------------------------------


BOX: dict[str, Any] = {"name": "crate", "x": 3.0, "y": 0.0, "length": 1.0, "width": 1.0}


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


def test_it_is_placed_and_stands_there() -> None:
    sim = SimFixture()
    sim.run(1.0)
    sim.after(1.0)
    sim.stop()
    assert sim.do(Place(x=-3.0, y=2.0, heading=math.pi)).ok
    assert (sim.truth.x, sim.truth.y, sim.truth.linear) == (-3.0, 2.0, 0.0)


def test_a_refused_request_changes_nothing_and_is_traced_with_its_reason() -> None:
    sim = SimFixture(room(BOX))
    reply = sim.do(Place(x=3.0, y=0.0))
    assert (reply.ok, reply.error) == (False, "an obstacle is at x 3, y 0")
    assert sim.do(GetTruth()).truth == sim.truth  # which leaves no line
    assert sim.truth.x == 0.0
    assert msgspec.to_builtins(sim.records) == [
        {
            "event": "fault",
            "mono_ns": START_NS,
            "request": {"do": "place", "x": 3.0, "y": 0.0, "heading": 0.0},
            "error": "an obstacle is at x 3, y 0",
        }
    ]


# --- trace ------------------------------------------------------------------------------------


def test_the_trace_knows_when_the_first_frame_said_so() -> None:
    sim = SimFixture(WALL_AHEAD)
    sim.run(1.0)
    sim.after(4.0)
    sim.do(Wire(drop=1.0))
    sim.say(c.BumperQuery())  # this answer does not arrive
    sim.do(Wire())
    assert sim.of(t.BumperSent) == []
    for linear in (0.0, -0.5):
        sim.say(c.BumperQuery())
        sim.say(c.BumperQuery())
        sim.run(linear)
        sim.after(1.0)
    sim.say(c.BumperQuery())
    assert [line.pressed for line in sim.of(t.BumperSent)] == [True, False]


LAP = (
    (0.8, 0.0, 1.0), (0.0, 1.0, 1.0), (0.6, 0.4, 1.0), (-0.3, -0.5, 2.0), (1.2, 0.1, 2.0),
)  # fmt: skip
LOSSY = Wire(drop=0.1, duplicate=0.1, corrupt=0.1, delay=0.02, jitter=0.03)
REQUESTS: tuple[Asked, ...] = Wire(), LOSSY, LOSSY, PowerCycle(), LOSSY


def lap(seed: int) -> tuple[bytes, bytes]:
    """Drive around a noisy room on a bad cable; return the trace and all bytes for the PC."""
    boxes = ({"name": "step", "x": 2.0, "y": 1.0, "length": 0.4, "width": 0.4, "low": True},)
    walls = [{"points": [[-2, -2], [4, -2], [4, 3], [-2, 3], [-2, -2]]}]
    sim = SimFixture(room(*boxes, walls=walls), model(sonar={"noise": 0.01}), seed)
    for (linear, angular, seconds), request in zip(LAP, REQUESTS, strict=True):
        sim.do(request)
        for _ in range(round(seconds * 10)):
            sim.run(linear, angular)
            sim.say(c.UltrasonicQuery(), c.BumperQuery())
            sim.after(0.1)
    trace = b"\n".join(msgspec.json.encode(line) for line in sim.records)
    return trace, b"".join(datagram.payload for datagram in sim.datagrams)


def test_the_same_seed_gives_the_same_trace_and_the_same_bytes() -> None:
    first = lap(1)
    assert first == lap(1)
    assert first[1] != lap(2)[1]


def test_an_incomplete_last_line_is_ignored() -> None:
    line = msgspec.json.encode(t.BumperSent(mono_ns=1, pressed=True)) + b"\n"
    assert t.read(line + b'{"event":"tru') == [t.BumperSent(mono_ns=1, pressed=True)]
