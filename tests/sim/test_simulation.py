import itertools
import math

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.freshness import S
from common.wire import commands as c
from common.wire import reports as r
from common.wire.frame import Frame, Side
from sim import trace as t
from sim.requests import Driver, Freeze, PowerCycle, Script, Sonar, Step, Wire
from sim.simulation import CATCH_UP_NS
from tests.sim.rig import EMPTY, PORTS, START_NS, Rig, config, room

WALL_AHEAD = room(walls=[{"points": [[3.0, -5.0], [3.0, 5.0]]}])
STEP_AHEAD = room({"name": "step", "x": 2.0, "y": 0.0, "length": 0.4, "width": 0.4, "low": True})
LED = c.LedSet(3, 1, 8, 2, 3, 4, 5, 6, 7)


def test_velocity_streams_to_both_ports_from_power_on() -> None:
    rig = Rig()
    assert len(rig.after(1.0)) == 100
    assert [datagram.port for datagram in rig.datagrams] == [*PORTS] * 50


def test_an_answer_goes_to_the_port_that_asked() -> None:
    rig = Rig()
    assert rig.say(c.BumperQuery(), port=4001) == [r.BumperReport(False)]
    assert rig.datagrams[-1].port == 4001


def test_every_frame_of_a_datagram_is_answered() -> None:
    asked: list[Frame] = [
        c.DistanceQuery(), c.UltrasonicQuery(), c.BumperQuery(), c.UltrasonicBrakeSet(True),
        c.BumperBrakeSet(False), c.DriverQuery(Side.LEFT), c.DriverQuery(Side.RIGHT), LED,
    ]  # fmt: skip
    answers = Rig().say(*asked)
    assert [answer.ID for answer in answers] == [query.ID for query in asked]


def test_bad_bytes_are_counted_and_what_follows_is_heard() -> None:
    rig = Rig()
    good = rig.framing.pack(c.BumperQuery())
    rig.simulation.receive(b"noise" + good[:3] + good, 4002, rig.now_ns)
    assert len(rig.simulation.take_sent(rig.now_ns)) == 1
    assert rig.simulation.counters["rejected_no_magic"] == 1
    assert rig.simulation.counters["BumperQuery"] == 1


def test_nobody_else_is_obeyed() -> None:
    rig = Rig()
    assert rig.say(c.BumperQuery(), c.MotionCommand(c.MotionKind.RUN, 500), port=None) == []
    assert rig.truth.command.kind == "stop"
    assert rig.simulation.counters["foreign"] == 1


def test_run_is_held_for_ever() -> None:
    rig = Rig()
    rig.run(0.5)
    rig.after(60.0)
    assert rig.truth.linear == 0.5
    assert rig.truth.x == pytest.approx(0.5 * 60, abs=0.2)


def test_stop_ramps_and_break_does_not() -> None:
    rig = Rig()
    rig.run(0.8)
    rig.after(2.0)
    rig.stop()
    rig.after(0.5)
    assert rig.truth.linear == pytest.approx(0.4, abs=0.02)
    rig.say(c.MotionCommand(c.MotionKind.BREAK))
    rig.after(0.01)
    assert rig.truth.linear == 0.0


def test_counters_are_what_was_really_driven() -> None:
    rig = Rig()
    rig.run(1.0, 0.5)
    rig.after(10.0)
    rig.stop()
    rig.after(3.0)
    truth = rig.truth
    heading = math.degrees(math.remainder(truth.heading, math.tau))
    assert rig.say(c.DistanceQuery()) == [
        r.DistanceReport(round(truth.distance * 1000), round(heading * 10))
    ]
    assert abs(truth.heading) > math.pi


def test_the_distance_driven_has_no_sign() -> None:
    rig = Rig()
    for linear in (1.0, -1.0):
        rig.run(linear)
        rig.after(3.0)
    rig.stop()
    rig.after(2.0)
    assert rig.truth.distance > 4.0
    (counted,) = rig.say(c.DistanceQuery())
    assert isinstance(counted, r.DistanceReport)
    assert counted.distance_mm < rig.truth.distance * 1000 - 1000


def test_a_wall_holds_it_and_presses_the_bumper() -> None:
    rig = Rig(WALL_AHEAD)
    rig.run(1.0)
    rig.after(4.0)
    assert rig.truth.x == pytest.approx(3.0 - 0.55, abs=1e-3)
    assert rig.truth.clearance == pytest.approx(0.0, abs=1e-3)
    assert (rig.truth.linear, rig.truth.contact) == (0.0, True)
    assert rig.say(c.BumperQuery()) == [r.BumperReport(True)]


def test_a_low_box_gives_no_echo_but_presses_the_bumper() -> None:
    rig = Rig(STEP_AHEAD)
    rig.run(0.5)
    rig.after(4.0)
    (ranges,) = rig.say(c.UltrasonicQuery())
    assert isinstance(ranges, r.UltrasonicReport)
    assert set(ranges.ranges_mm) == {5000}
    assert (rig.truth.contact, rig.truth.clearance) == (True, None)
    assert rig.truth.x == pytest.approx(1.8 - 0.55, abs=1e-3)


def test_it_backs_off_a_step_with_its_bumper_brake_on() -> None:
    rig = Rig(STEP_AHEAD)
    rig.say(c.BumperBrakeSet(True))
    rig.run(0.5)
    rig.after(4.0)
    assert rig.truth.braking
    touching = rig.truth.x
    rig.run(-0.1)
    rig.after(1.0)
    assert rig.truth.x < touching - 0.05
    assert (rig.truth.contact, rig.truth.braking) == (False, False)


def test_the_sonar_brake_keeps_it_from_the_wall() -> None:
    rig = Rig(WALL_AHEAD)
    rig.say(c.UltrasonicBrakeSet(True))
    rig.run(0.3)
    rig.after(15.0)
    assert rig.truth.clearance == pytest.approx(0.14, abs=0.02)
    assert (rig.truth.linear, rig.truth.command.kind) == (0.0, "run")


def test_ranges_are_renewed_at_their_own_rate() -> None:
    rig = Rig(WALL_AHEAD)
    rig.run(1.0)
    rig.after(1.5)
    seen = []
    for _ in range(20):
        rig.after(0.01)
        seen += rig.say(c.UltrasonicQuery())
    assert len(set(seen)) in (4, 5)


def test_a_driver_fault_is_reported_unasked_once_and_to_both_ports() -> None:
    rig = Rig()
    rig.do(Driver(side="right", bits=0x80000001))
    rig.do(Driver(side="right", bits=0x80000001))
    report = r.DriverReport(Side.RIGHT, 0x80000001)
    assert rig.after(0.1).count(report) == 2
    assert rig.say(c.DriverQuery(Side.RIGHT), c.DriverQuery(Side.LEFT)) == [
        report,
        r.DriverReport(Side.LEFT, 0),
    ]
    rig.do(Driver(side="right", bits=0))
    assert not any(isinstance(frame, r.DriverReport) for frame in rig.after(0.1))


def test_a_frozen_board_neither_speaks_nor_hears_and_drives_on() -> None:
    rig = Rig()
    rig.run(0.5)
    rig.after(1.0)
    rig.do(Freeze(seconds=0.5))
    rig.do(Driver(side="left", bits=1))
    rig.stop()
    assert rig.after(0.49) == []
    assert rig.truth.silent
    assert rig.simulation.counters["unheard"] == 1
    assert (rig.truth.linear, rig.truth.command.kind) == (0.5, "run")
    assert r.VelocityReport(500, 0) in rig.after(0.1)


def test_a_power_cycle_stops_it_and_clears_counters_and_switches() -> None:
    rig = Rig()
    rig.say(c.BumperBrakeSet(True))
    rig.run(0.5)
    rig.after(2.0)
    rig.do(PowerCycle(seconds=1.0))
    assert rig.after(0.99) == []
    assert (rig.truth.linear, rig.truth.command.kind) == (0.0, "stop")
    assert rig.after(0.1)
    assert rig.say(c.DistanceQuery()) == [r.DistanceReport(0, 0)]
    assert not rig.truth.bumper_brake
    assert [(line.on, line.mono_ns - START_NS) for line in rig.of(t.Power)] == [
        (False, 2 * S),
        (True, 3 * S),
    ]


def test_commands_are_traced_in_si_and_queries_only_counted() -> None:
    rig = Rig()
    rig.after(0.25)
    rig.say(
        c.BumperQuery(),
        c.MotionCommand(c.MotionKind.RUN, -250, 900),
        c.MotionCommand(c.MotionKind.STOP),
        c.MotionCommand(c.MotionKind.BREAK),
    )
    lines = [msgspec.to_builtins(line) for line in rig.of(t.Command)]
    assert [line["kind"] for line in lines] == ["run", "stop", "break"]
    assert lines[0] == {
        "event": "command",
        "mono_ns": START_NS + S // 4,
        "kind": "run",
        "linear": -0.25,
        "angular": pytest.approx(math.pi / 2),
    }
    assert rig.simulation.counters["BumperQuery"] == 1


def test_the_trace_knows_when_the_first_frame_said_so() -> None:
    rig = Rig(WALL_AHEAD)
    rig.run(1.0)
    rig.after(4.0)
    assert rig.of(t.BumperSent) == []
    for linear in (0.0, -0.5):
        rig.say(c.BumperQuery())
        rig.say(c.BumperQuery())
        rig.run(linear)
        rig.after(1.0)
    rig.say(c.BumperQuery())
    assert [line.pressed for line in rig.of(t.BumperSent)] == [True, False]


@pytest.mark.parametrize("lost", [Wire(foreign=1.0), Wire(drop=1.0)])
def test_a_frame_that_does_not_arrive_said_nothing(lost: Wire) -> None:
    rig = Rig()
    rig.simulation.hand_on_bumper = True
    rig.simulation.feel()
    rig.simulation.to_pc.faults = lost
    rig.say(c.BumperQuery())
    assert rig.of(t.BumperSent) == []
    rig.simulation.to_pc.faults = Wire()
    rig.say(c.BumperQuery())
    assert len(rig.of(t.BumperSent)) == 1


def test_a_delayed_command_is_obeyed_when_it_arrives() -> None:
    rig = Rig()
    rig.simulation.to_board.faults = Wire(delay=0.2)
    rig.run(0.5)
    rig.after(0.19)
    assert rig.of(t.Command) == []
    rig.after(0.02)
    assert [line.kind for line in rig.of(t.Command)] == ["run"]


def test_a_command_from_a_foreign_address_is_not_obeyed() -> None:
    rig = Rig()
    rig.simulation.to_board.faults = Wire(foreign=1.0)
    rig.run(0.5)
    assert rig.truth.command.kind == "stop"
    assert rig.simulation.counters["foreign"] == 1


def test_a_late_tick_is_caught_up() -> None:
    rig = Rig()
    rig.run(1.0)
    rig.injection.advance(START_NS + CATCH_UP_NS)
    assert rig.simulation.now_ns == START_NS + CATCH_UP_NS
    assert rig.simulation.counters["holes"] == 0


def test_a_hole_is_left_out() -> None:
    rig = Rig()
    rig.run(1.0)
    rig.injection.advance(START_NS + 60 * S)
    assert rig.simulation.now_ns == START_NS + 60 * S
    assert rig.simulation.counters["holes"] == 1
    assert rig.truth.x < 1.0


def test_truth_comes_at_20_hz() -> None:
    rig = Rig(WALL_AHEAD)
    rig.after(1.0)
    lines = rig.of(t.Truth)
    assert len(lines) == 20
    assert {b.mono_ns - a.mono_ns for a, b in itertools.pairwise(lines)} == {S // 20}
    assert lines[-1].clearance == pytest.approx(3.0 - 0.55)


LAP = (
    (0.8, 0.0, 3.0), (0.0, 1.0, 1.6), (0.6, 0.4, 4.0), (-0.3, -0.5, 2.0), (1.2, 0.1, 5.0),
)  # fmt: skip


def lap(seed: int) -> tuple[bytes, bytes]:
    """Drive around a noisy room on a bad cable; return the trace and all bytes for the PC."""
    boxes = ({"name": "step", "x": 2.0, "y": 1.0, "length": 0.4, "width": 0.4, "low": True},)
    walls = [{"points": [[-2, -2], [4, -2], [4, 3], [-2, 3], [-2, -2]]}]
    script = Script(steps=(Step(at=9.0, request=PowerCycle()), Step(at=4.0, request=LOSSY)))
    noisy = config(sim={"seed": seed, "sonar_noise": 0.01})
    rig = Rig(room(*boxes, walls=walls), noisy, script)
    for linear, angular, seconds in LAP:
        for _ in range(round(seconds * 10)):
            rig.run(linear, angular)
            rig.say(c.UltrasonicQuery(), c.BumperQuery())
            rig.after(0.1)
    trace = b"\n".join(msgspec.json.encode(line) for line in rig.records)
    return trace, b"".join(datagram.payload for datagram in rig.datagrams)


LOSSY = Wire(drop=0.1, duplicate=0.1, reorder=0.1, corrupt=0.1, join=0.1, delay=0.02)


def test_the_same_seed_gives_the_same_trace_and_the_same_bytes() -> None:
    first = lap(1)
    assert first == lap(1)
    assert first[1] != lap(2)[1]


hostile = st.lists(
    st.one_of(
        st.builds(
            c.MotionCommand,
            st.sampled_from(c.MotionKind),
            st.integers(-32767, 32767),
            st.integers(-32767, 32767),
        ).map(lambda frame: [frame]),
        st.sampled_from([c.BumperBrakeSet(True), c.UltrasonicBrakeSet(True)]).map(lambda f: [f]),
        st.binary(max_size=40),
    ),
    max_size=8,
)


@settings(max_examples=40, deadline=None)
@given(hostile, st.floats(-3.0, 3.0))
def test_it_never_penetrates_and_is_always_finite(
    said: list[list[Frame] | bytes], heading: float
) -> None:
    start = {"x": 0.0, "y": 0.0, "heading": heading}
    walls = [{"points": [[-1, -1], [1.5, -1], [1, 1], [-1, 2], [-1, -1]]}]
    post = {"name": "post", "x": 0.9, "y": 0.0, "length": 0.02, "width": 0.02, "low": True}
    rig = Rig(room(post, start=start, walls=walls))
    world, body = rig.simulation.world, rig.simulation.body
    for part in said:
        if isinstance(part, bytes):
            rig.simulation.receive(part, 4002, rig.now_ns)
        else:
            rig.say(*part)
        for _ in range(10):
            rig.after(0.02)
            assert not world.blocks(body, rig.simulation.pose)
            truth = rig.truth
            numbers = truth.x, truth.y, truth.heading, truth.linear, truth.angular, truth.distance
            assert all(math.isfinite(number) for number in numbers)


def test_the_angular_unit_of_the_wire_is_obeyed() -> None:
    rig = Rig(EMPTY, config(wire={"angular_unit": "milliradian"}))
    rig.say(c.MotionCommand(c.MotionKind.RUN, 0, 500))
    said = rig.after(1.0)
    assert rig.truth.angular == pytest.approx(0.5)
    assert said[-1] == r.VelocityReport(0, 500)


def test_the_crc_of_the_wire_is_obeyed() -> None:
    rig = Rig(EMPTY, config(wire={"crc": "xmodem", "crc_covers": "header_and_payload"}))
    assert rig.say(c.BumperQuery()) == [r.BumperReport(False)]
    plain = Rig().framing.pack(c.BumperQuery())
    rig.simulation.receive(plain, 4002, rig.now_ns)
    assert rig.simulation.counters["rejected_bad_crc"] == 1


def test_a_stuck_sonar_reports_its_last_range() -> None:
    rig = Rig(WALL_AHEAD)
    rig.after(0.1)
    before = rig.say(c.UltrasonicQuery())
    rig.do(Sonar(name="front", stuck=True))
    rig.run(0.5)
    rig.after(1.0)
    after = rig.say(c.UltrasonicQuery())
    assert isinstance(before[0], r.UltrasonicReport)
    assert isinstance(after[0], r.UltrasonicReport)
    assert after[0].ranges_mm[2] == before[0].ranges_mm[2]
    assert after[0].ranges_mm[1] < before[0].ranges_mm[1]
