"""The bridge's core: what each datagram, motion and call leads to, and in which order."""

import math
from collections.abc import Callable

import msgspec
import pytest

from common.freshness import NS_PER_S
from common.motion import BRAKE, STOP
from common.wire import commands, framing, reports
from common.wire.commands import MotionKind
from common.wire.frame import HEADER, Frame, Side
from common.wire.framing import checksum
from common.wire.reports import BumperReport, DistanceReport, DriverReport, VelocityReport
from services.bridge.core.output import Event, Output, Publish, Reacted, Refuse, Send
from t2 import messages as m
from t2 import words
from t2.messages import Command
from t2.words import render
from tests.bridge.core.core_fixture import (
    BOOT,
    CLEAR,
    HIT,
    MS,
    NOW,
    SAFETY,
    STANDS,
    Bench,
    Caller,
    events,
    frames,
    motions,
    pressed,
    published,
    reactions,
)
from tests.factories import safety_state


@pytest.fixture
def bench() -> Bench:
    return Bench()


# --- a hit ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("datagram", [HIT, STANDS + HIT, HIT + STANDS, HIT + HIT, CLEAR + HIT])
def test_brake_comes_first_then_the_report_of_the_hit_then_the_rest(
    bench: Bench, datagram: bytes
) -> None:
    bench.receive(CLEAR, CLEAR, CLEAR, CLEAR)
    out = bench.receive(datagram, HIT, HIT)
    assert isinstance(out[0], Send)
    assert out[1] == Reacted("reflex", NOW)
    assert isinstance(out[2], Publish)
    assert isinstance(out[2].message, m.Bumper)
    assert out[2].message.pressed
    assert out[3] == Event("contact", "error")
    assert (motions(out), events(out), reactions(out)) == (
        [MotionKind.BREAK], ["contact"], ["reflex"],
    )  # fmt: skip
    assert all(pressed(out))
    assert len(pressed(out)) == 3 + (datagram in (HIT + HIT, CLEAR + HIT))
    assert bench.core.motions.lease.hit == 3


def test_brake_leaves_before_the_rest_is_read(bench: Bench) -> None:
    datagram = HIT + b"damaged"
    for output in bench.core.datagram(datagram, 0, NOW):
        assert isinstance(output, Send)
        assert not bench.core.rejected
        break


def test_brake_for_a_plain_hit_leaves_before_it_is_read(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    outputs = iter(bench.core.datagram(HIT, 0, NOW))
    with monkeypatch.context() as unreadable:
        unreadable.setattr(framing, "read", None)
        first = [next(outputs), next(outputs)]
    assert (motions(first), reactions(first)) == ([MotionKind.BREAK], ["reflex"])


def test_each_new_hit_of_a_datagram_brakes(bench: Bench) -> None:
    bench.receive(CLEAR)
    out = bench.receive(HIT + CLEAR * 3 + HIT)
    assert motions(out) == [MotionKind.BREAK] * 2
    assert events(out) == ["contact"] * 2
    bench.receive(CLEAR, CLEAR, CLEAR)
    assert motions(bench.receive(HIT)) == [MotionKind.BREAK]


@pytest.mark.parametrize("form", ["alone", "behind", "before"])
def test_a_hit_on_the_other_port_counts_at_once(bench: Bench, form: str) -> None:
    hit = HEADER.pack(BumperReport.OPENING, checksum(b"\x80")) + b"\x80"
    datagram = {"alone": hit, "behind": STANDS + hit, "before": hit + CLEAR}[form]
    bench.receive(CLEAR, CLEAR, CLEAR)
    out = bench.receive(datagram, datagram, port=1)
    assert motions(out) == [MotionKind.BREAK]
    assert pressed(out)[0]
    assert bench.core.motions.lease.hit is not None
    assert pressed(bench.receive(CLEAR, CLEAR, CLEAR, CLEAR)) == [], "the hit's port is active"


def test_clear_samples_do_not_count_while_the_other_port_shows_the_hit(bench: Bench) -> None:
    bench.receive(HIT)
    for _ in range(5):
        bench.receive(CLEAR, CLEAR)
        bench.receive(HIT, port=1)
    bench.move(BRAKE, judged=99, judged_boot=BOOT)
    assert pressed(bench.receive(CLEAR, CLEAR)) == [True, True]
    assert pressed(bench.receive(CLEAR)) == [False]


def test_a_clear_sample_before_the_hit_does_not_count(bench: Bench) -> None:
    bench.receive(CLEAR + HIT, CLEAR, CLEAR)
    bench.move(BRAKE, judged=99, judged_boot=BOOT)
    assert bench.core._bumper.pressed


def test_a_short_hit_is_reported_until_safety_has_acknowledged_it(bench: Bench) -> None:
    assert pressed(bench.receive(HIT, *[CLEAR] * 5)) == [True] * 6
    bench.move(BRAKE, judged=1, judged_boot=BOOT)
    assert pressed(bench.receive(CLEAR)) == [False]


@pytest.mark.parametrize(("command", "found"), [(STOP, []), (BRAKE, ["judged_stop"])])
def test_the_judged_stop_is_a_brake_that_acknowledges_the_hit(
    bench: Bench, command: Command, found: list[str]
) -> None:
    bench.receive(HIT)
    bench.now_ns += MS
    outs = [bench.move(command, judged=seq, judged_boot=BOOT) for seq in (0, 1, 1)]
    assert [reactions(out) for out in outs] == [[], found, []]
    assert all(motions(out) for out in outs)
    if found:
        assert outs[1][1] == Reacted("judged_stop", NOW)


# --- other frames ---------------------------------------------------------------------------------


def test_each_frame_is_published_with_its_raw_bytes(bench: Bench) -> None:
    bench.tick()
    for frame, stream in (
        (VelocityReport(100, 0), "velocity"),
        (DistanceReport(1000, 0), "mileage"),
        (reports.UltrasonicReport((1000, *(2500,) * 7)), "ultrasonic"),
        (DriverReport(Side.RIGHT, 0), "driver_right"),
        (BumperReport(True), "bumper"),
    ):
        (made,) = [out for out in bench.answer(frame) if isinstance(out, Publish)]
        assert (made.stream, made.raw) == (stream, framing.pack(frame))
    assert published(bench.outputs, "velocity") == [m.Velocity(linear=0.1, angular=0.0)]
    assert published(bench.outputs, "mileage") == [m.Mileage(distance=1.0, heading=0.0, epoch=0)]
    (ranges,) = published(bench.outputs, "ultrasonic")
    assert ranges.ranges == (1.0, *(2.5,) * 7)
    bench.carried_out(bench.core.second())
    assert bench.link().rates["VelocityReport"] == 1.0
    out = bench.carried_out(bench.core.second())
    assert (bench.link().rates, out) == ({}, [Publish("switches", m.Switches())])


LEFT = {"side": "left"}


def test_a_driver_fault_counts_from_either_port(bench: Bench) -> None:
    reported, seen = [], []
    for port, bits in ((0, 0), (1, 1), (0, 0), (0, 1), (1, 0), (0, 3), (1, 3)):
        out = bench.answer(DriverReport(Side.LEFT, bits), port=port)
        reported += [message.bits for message in published(out, "driver_left")]
        seen += [out for out in out if isinstance(out, Event) and out.name == "driver_fault"]
    assert reported == [0, 1, 0, 3]
    (right,) = published(bench.answer(DriverReport(Side.RIGHT, 1), port=1), "driver_right")
    assert right.bits == 1
    assert [(it.level, it.about, render(it.phrases)) for it in seen] == [
        ("error", LEFT | {"bits": 1}, "The left motor driver reports: over current."),
        ("info", LEFT | {"bits": 0}, "The left motor driver reports no fault."),
        ("error", LEFT | {"bits": 3}, "The left motor driver reports: over current, over voltage."),
    ]


def test_copies_are_dropped_and_counted(bench: Bench) -> None:
    came = ((0, STANDS), (1, STANDS), (1, STANDS + CLEAR), (0, STANDS))
    velocities = [
        published(bench.receive(datagram, port=port), "velocity") for port, datagram in came
    ]
    assert [len(each) for each in velocities] == [1, 0, 0, 1]
    assert bench.counters["other_port"] == 2


def test_a_dead_port_is_left_and_reported(bench: Bench) -> None:
    bench.receive(STANDS)
    bench.now_ns += 100 * MS
    assert bench.receive(STANDS, port=1) == []
    bench.now_ns += MS
    out = bench.receive(STANDS, STANDS, port=1)
    assert len(published(out, "velocity")) == 2
    assert [one for one in out if isinstance(one, Event)] == [
        Event("port_changed", "warning", {"port": 4001})
    ]
    assert bench.core.motions.port == 1
    assert bench.link().ports == {"VelocityReport": 4001}
    bench.answer(BumperReport(False))
    assert "port_changed" not in events(bench.answer(BumperReport(True), port=1))


def test_what_no_vehicle_can_mean_is_dropped_and_counted(bench: Bench) -> None:
    for count in (1, 2):
        out = bench.receive(b"nonsense", framing.pack(VelocityReport(30_000, 0)))
        assert out == []
        bench.core.relay_report(b"nonsense", NOW)
        rejected = dict.fromkeys(("no_magic", "implausible", "relay_report"), count)
        assert bench.link().rejected == rejected
    assert bench.core.readiness.link == "never"


def test_clear_samples_count_across_ticks(bench: Bench) -> None:
    found = []
    for _ in range(3):
        found += pressed(bench.receive(CLEAR))
        bench.tick(20 * MS)
    assert found == [False]


def link_lost(bench: Bench) -> None:
    assert "link_lost" in events(bench.tick(NS_PER_S))


def board_restarted(bench: Bench) -> None:
    bench.answer(DistanceReport(1000, 0))
    assert "board_restarted" in events(bench.answer(DistanceReport(0, 0)))


@pytest.mark.parametrize("gap", [link_lost, board_restarted])
@pytest.mark.parametrize("first", [True, False])
def test_a_row_of_clear_samples_begins_anew_after_a_gap(
    bench: Bench, gap: Callable[[Bench], None], first: bool
) -> None:
    bench.receive(HIT if first else CLEAR, CLEAR, CLEAR, *[CLEAR] * (not first))
    bench.move(BRAKE, judged=99, judged_boot=BOOT)
    gap(bench)
    assert pressed(bench.receive(CLEAR, CLEAR)) == []
    assert pressed(bench.receive(CLEAR)) == [False]
    gap(bench)
    assert motions(bench.receive(HIT)) == [MotionKind.BREAK]


@pytest.mark.parametrize("confirms", [True, False])
def test_a_board_that_restarts_disarms_at_once(confirms: bool) -> None:
    unsafe = "board.require_switches=false", "unsafe_overrides=board.require_switches"
    bench = Bench(*(() if confirms else unsafe))
    bench.arm()
    assert motions(bench.move(linear=0.3)) == [MotionKind.RUN]
    board_restarted(bench)
    assert motions(bench.move(linear=0.3)) == [MotionKind.STOP]
    assert bench.link().epoch == published(bench.outputs, "mileage")[-1].epoch == 1


def test_after_silence_the_brakes_are_confirmed_and_a_neutral_motion_is_due(
    bench: Bench,
) -> None:
    bench.arm()
    bench.move(linear=0.3)
    bench.now_ns += 201 * MS
    assert motions(bench.tick(0)) == [MotionKind.STOP]
    assert motions(bench.move(linear=0.3)) == [MotionKind.STOP]
    bench.receive(STANDS)
    assert motions(bench.move(linear=0.3)) == motions(bench.move(STOP)) == [MotionKind.STOP]
    bench.answer(reports.UltrasonicBrakeReport(True), reports.BumperBrakeReport(True))
    bench.tick(0)
    assert motions(bench.move(linear=0.3)) == motions(bench.move(STOP)) == [MotionKind.STOP]
    assert motions(bench.move(linear=0.3)) == [MotionKind.RUN]


# --- readiness ------------------------------------------------------------------------------------


@pytest.mark.parametrize("port", [0, 1])
@pytest.mark.parametrize(
    "off", [reports.UltrasonicBrakeReport(False), reports.BumperBrakeReport(False)]
)
def test_a_brake_that_is_off_disarms_at_once(bench: Bench, off: Frame, port: int) -> None:
    bench.arm()
    assert motions(bench.move(linear=0.3)) == [MotionKind.RUN]
    assert len(published(bench.answer(off, port=port), "switches")) == 1
    assert motions(bench.move(linear=0.3)) == [MotionKind.STOP]
    assert not bench.link().armed


def test_brakes_that_are_no_longer_confirmed_inhibit_and_are_published(bench: Bench) -> None:
    bench.arm()
    reported: list[m.Switches] = []
    for _ in range(5):
        assert bench.core.readiness.ready
        bench.receive(STANDS)
        reported += published(bench.tick(NS_PER_S // 5), "switches")
    assert not bench.core.motions.lease.ready
    assert reported == [m.Switches(ultrasonic_brake=None, bumper_brake=None)]


def test_the_link_message_comes_at_5_hz_and_on_a_change(bench: Bench) -> None:
    assert len(published(bench.tick(), "link")) == 1
    counts = [len(published(bench.tick(20 * MS), "link")) for _ in range(20)]
    assert counts == [*[0] * 9, 1] * 2
    assert [len(published(bench.tick(ms * MS), "link")) for ms in (189, 1)] == [0, 1]
    bench.receive(STANDS)
    (link,) = published(bench.tick(20 * MS), "link")
    assert (link.state, link.board) == ("up", "127.0.0.1:4003")


def test_the_link_message(bench: Bench) -> None:
    link = m.Link(
        state="never", board="127.0.0.1:4003", epoch=0, armed=False, rates={}, rejected={},
        waiting="Nothing received from the board yet on UDP port 4002, 4001.",
        waiting_phrases=(m.Phrase("waiting.board", {"ports": "4002, 4001"}),), round_trip=None,
    )  # fmt: skip
    assert bench.link() == link
    bench.tick()
    bench.arm()
    bench.counters["send_errors"], bench.core.rejected["wrong_address"] = 3, 0
    bench.carried_out(bench.core.second())
    bench.now_ns += 4 * MS
    bench.answer(DistanceReport(1000, 0))
    kinds = ("VelocityReport", "DistanceReport", "UltrasonicBrakeReport", "BumperBrakeReport")
    assert bench.link() == msgspec.structs.replace(
        link, state="up", armed=True, waiting="", waiting_phrases=(), send_errors=3, round_trip=0.0,
        rates={"BumperReport": 4.0} | dict.fromkeys(kinds, 1.0),
        ports=dict.fromkeys(("BumperReport", *kinds), 4002),
    )  # fmt: skip
    bench.estop()
    waiting = "Safety has not acknowledged the emergency stop."
    assert (bench.link().waiting, bench.link().estop) == (waiting, bench.now_ns)


def test_each_query_finds_its_tick() -> None:
    bench = Bench()
    assert bench.core.motions.lease.over_since_ns == NOW
    out = bench.tick()
    assert {send.port for send in out if isinstance(send, Send)} == {0}
    asked = [type(frame).__name__ for frame in frames(out)]
    assert asked[1:] == [
        "BumperQuery", "DistanceQuery", "UltrasonicQuery", "DriverQuery", "DriverQuery",
    ]  # fmt: skip
    assert commands.BumperQuery() in frames(bench.tick(11 * MS)), "at the nearest tick"


@pytest.mark.parametrize(
    "steps",  # wait (ms), mileage (mm) or a velocity, whether that shows a restart
    [
        # Counters alone that were silent went on.
        [(0, 1000, False), *[(100, None, False)] * 40, (0, 4200, False)],
        # A gap before the last sample is no gap behind it.
        [(0, None, False), (100, 100, False), (20, 30, False), (61, None, False), (0, 30, False),
         (100, None, False), (0, 400, False), (100, None, False), (0, 100, True)],
        # The frame that ends a gap may be the one that shows a restart; before, it was driven.
        [(0, 400, False), (60, 60, False), (0, 400, False), (61, 60, True)],
    ],
)  # fmt: skip
def test_a_restart_shows_in_counters_behind_a_gap(
    bench: Bench, steps: list[tuple[int, int | None, bool]]
) -> None:
    for wait_ms, millimetres, restarted in steps:
        bench.now_ns += wait_ms * MS
        frame = VelocityReport(0, 0) if millimetres is None else DistanceReport(millimetres, 0)
        assert ("board_restarted" in events(bench.answer(frame))) is restarted


def test_the_frame_that_ends_a_lost_link_is_judged_as_such(bench: Bench) -> None:
    bench.answer(DistanceReport(400, 0))
    link_lost(bench)
    bench.now_ns += NS_PER_S
    assert "board_restarted" not in events(bench.answer(DistanceReport(100, 0)))
    link_lost(bench)
    bench.now_ns += NS_PER_S
    assert "board_restarted" in events(bench.answer(DistanceReport(3000, 0)))
    for first in ((), (VelocityReport(0, 0),)):
        bench.answer(DistanceReport(100, 0))
        link_lost(bench)
        bench.now_ns += NS_PER_S
        assert "board_restarted" in events(bench.answer(*first, DistanceReport(3000, 0)))


# --- motions --------------------------------------------------------------------------------------


def test_a_second_authority_is_an_event_once(bench: Bench) -> None:
    bench.arm()
    for boot in (SAFETY, 2, 2, SAFETY, 2, 3):
        bench.move(STOP, boot=boot)
    assert [one for one in bench.outputs if isinstance(one, Event) and one.name != "link_up"] == [
        Event("second_authority", "error", {"boot": boot}) for boot in (2, 3)
    ]
    assert bench.counters["motion_second_authority"] == 4


def test_a_run_carries_the_velocities(bench: Bench) -> None:
    bench.arm()
    (frame,) = frames(bench.move(linear=0.3, angular=-math.radians(30)))
    assert frame == commands.MotionCommand(MotionKind.RUN, 300, -300)


def test_an_emergency_stop_brakes_at_once_until_safety_has_latched_it(bench: Bench) -> None:
    bench.arm()
    bench.move()
    assert motions(bench.estop()) == [MotionKind.BREAK]
    assert bench.estop() == [], "repeated until it is confirmed"
    assert bench.link().estop == bench.now_ns
    assert motions(bench.move(linear=0.5)) == [MotionKind.BREAK]
    bench.move(BRAKE, estop=bench.now_ns)
    bench.move(STOP)
    assert motions(bench.move(linear=0.5)) == [MotionKind.RUN]


def test_motion_without_a_command_brakes_and_is_an_event(bench: Bench) -> None:
    bench.tick()
    for speed in (0, 0, *[100] * 80):
        bench.answer(VelocityReport(speed, 0))
        bench.tick(20 * MS)
    assert events(bench.outputs).count("uncommanded_motion") == 1
    assert motions(bench.outputs).count(MotionKind.BREAK) > 10
    assert bench.link().latched_by == BOOT


def test_counters_that_move_without_a_command_brake(bench: Bench) -> None:
    bench.arm()
    for millimetres in (0, 0, 30, 49, 50):
        assert "uncommanded_motion" not in events(bench.outputs)
        bench.answer(VelocityReport(0, 0), DistanceReport(1000 + millimetres, 0))
        bench.tick(201 * MS)
    assert "uncommanded_motion" in events(bench.outputs)


@pytest.mark.parametrize(("speed", "kind"), [(0, MotionKind.STOP), (100, MotionKind.BREAK)])
def test_a_vehicle_that_goes_on_after_the_lease_is_braked(
    bench: Bench, speed: int, kind: MotionKind
) -> None:
    bench.arm()
    for _ in range(60):
        bench.answer(VelocityReport(speed, 0))
        bench.tick(20 * MS)
    assert motions(bench.outputs)[-1] is kind
    link_lost(bench)
    assert motions(bench.tick(2 * NS_PER_S)) == [MotionKind.BREAK], "not known to stand"


@pytest.mark.parametrize(("command", "kind"), [(STOP, MotionKind.STOP), (BRAKE, MotionKind.BREAK)])
def test_a_bridge_that_ends_does_not_take_a_brake_back(
    bench: Bench, command: Command, kind: MotionKind
) -> None:
    bench.arm()
    bench.move(command)
    assert motions(bench.carried_out(bench.core.motions.stop(bench.now_ns))) == [kind]
    assert bench.carried_out(bench.core.motions.stop(bench.now_ns)) == [], "once"
    bench.now_ns += MS
    bench.answer(VelocityReport(0, 0))
    assert motions([bench.core.motions.on_exit(bench.now_ns)]) == [kind], "it holds the vehicle"
    bench.tick()
    assert motions(bench.move(linear=0.3)) == [MotionKind.STOP]


@pytest.mark.parametrize(("speed", "kind"), [(0, MotionKind.STOP), (300, MotionKind.BREAK)])
def test_the_last_frame_brakes_unless_the_vehicle_stands(
    bench: Bench, speed: int, kind: MotionKind
) -> None:
    bench.arm()
    core = bench.core
    assert not core.motions.is_stopped(bench.now_ns + 9 * NS_PER_S), "nobody has asked"
    assert motions([core.motions.on_exit(bench.now_ns)]) == [MotionKind.BREAK]
    bench.carried_out(core.motions.stop(bench.now_ns))
    assert not core.motions.is_stopped(bench.now_ns), "measured before the stop"
    bench.now_ns += MS
    bench.answer(VelocityReport(speed, 0))
    assert core.motions.is_stopped(bench.now_ns) is (speed == 0)
    assert motions([core.motions.on_exit(bench.now_ns)]) == [kind]
    assert not core.motions.is_stopped(bench.now_ns + NS_PER_S - MS) or speed == 0
    assert core.motions.is_stopped(bench.now_ns + NS_PER_S), "it waits no longer"


# --- calls ----------------------------------------------------------------------------------------


def nothing(_: Bench) -> None:
    """Leave the board silent."""


def echo(frame: Frame) -> Callable[[Bench], object]:
    return lambda bench: bench.answer(frame, frame)


def late(bench: Bench) -> None:
    """Keep the board connected until the echo is overdue."""
    for step in (*[20 * MS] * 24, 10 * MS):
        bench.receive(STANDS)
        bench.tick(step)
    assert not any(isinstance(one, Refuse) for one in bench.outputs)
    bench.tick(1)


def lamp(bench: Bench, caller: Caller) -> list[Output]:
    return bench.lamp(caller)


def brakes(bench: Bench, caller: Caller) -> list[Output]:
    return bench.switch(caller, bumper_brake=False, echo=7)


def called_late(bench: Bench, caller: Caller) -> list[Output]:
    bench.now_ns += NS_PER_S + 1
    return brakes(bench, caller)


Call = Callable[[Bench, Caller], list[Output]]
ONE_OFF = m.Switches(ultrasonic_brake=True, bumper_brake=False)


@pytest.mark.parametrize(
    ("call", "then", "reply", "refusal"),
    [
        (lamp, echo(reports.LedReport(True)), words.done(m.Phrase("board.lamp_set")), None),
        (lamp, echo(reports.LedReport(False)), None, "The board reports a failure (0xAA)."),
        (lamp, late, None, "The board did not confirm it within 0.5 s."),
        (lamp, lambda bench: lamp(bench, Caller()), None, None),
        (brakes, echo(reports.BumperBrakeReport(False)), ONE_OFF, None),
        (brakes, late, None, "The board did not confirm it within 0.5 s."),
    ],
)
def test_a_call_is_answered_by_the_boards_echo(
    bench: Bench, call: Call, then: Callable[[Bench], object], reply: object, refusal: str | None
) -> None:
    bench.arm()
    bench.core.calls.on_safety(safety_state(heartbeat=7), bench.now_ns)
    caller = Caller()
    sent = [*call(bench, caller), *bench.tick()]
    assert {type(frame) for frame in frames(sent)} & {commands.LedSet, commands.BumperBrakeSet}
    assert (caller.replies, caller.refusals) == ([], [])
    then(bench)
    bench.tick()
    assert caller.replies == ([reply] if reply else [])
    assert caller.refusals == ([refusal] if refusal else [])


@pytest.mark.parametrize(
    ("before", "call", "refusal"),
    [
        (nothing, lamp, "The board is absent (link never up)."),
        (nothing, brakes, "The board is absent (link never up)."),
        (Bench.arm, lambda bench, to: bench.switch(to, bumper_brake=False), "no echo"),
        (Bench.arm, lambda bench, to: bench.switch(to, echo=1), "unknown state of safety"),
        (Bench.arm, called_late, "The call is 1.0 s old, allowed is 1 s"),
    ],
)
def test_a_call_is_refused_with_the_reason(
    bench: Bench, before: Callable[[Bench], None], call: Call, refusal: str
) -> None:
    before(bench)
    bench.core.calls.on_safety(safety_state(heartbeat=7), bench.now_ns)
    caller = Caller()
    assert frames(call(bench, caller)) == []
    assert refusal in caller.refusals[0]


@pytest.mark.parametrize(("call", "what"), [(lamp, "lamps"), (brakes, "switches")])
def test_one_call_of_each_is_pending(bench: Bench, call: Call, what: str) -> None:
    bench.arm()
    bench.core.calls.on_safety(safety_state(heartbeat=7), bench.now_ns)
    first, second = Caller(), Caller()
    call(bench, first)
    call(bench, second)
    assert (first.refusals, second.refusals) == ([], [f"Another call for the {what} is pending."])
