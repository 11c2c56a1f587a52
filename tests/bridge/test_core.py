"""The bridge's core through its entries: what each input leads to."""

import math
from typing import Any

import pytest

from common import messages as m
from common.freshness import NS_PER_S
from common.motion import Command
from common.wire import commands, reports
from common.wire.commands import MotionKind
from common.wire.frame import Frame, Side
from common.wire.reports import DistanceReport, DriverReport, VelocityReport
from services.bridge.output import Output
from tests.bridge.core_fixture import (
    BOOT,
    CLEAR,
    FRAMING,
    HIT,
    MS,
    SAFETY,
    STANDS,
    Bench,
    events,
    frames,
    motions,
    pressed,
    published,
)


def test_the_first_frame_is_a_stop(bench: Bench) -> None:
    assert motions(bench.outs[0]) == [MotionKind.STOP]


# --- what comes from the board ------------------------------------------------------------------


def test_a_driver_fault_that_is_reported_on_the_other_port_alone_counts(bench: Bench) -> None:
    reported = []
    for port, bits in ((0, 0), (1, 1), (0, 0), (0, 1), (1, 0), (0, 3), (1, 3)):
        out = bench.answer(DriverReport(Side.LEFT, bits), port=port)
        reported += [message.bits for message in published(out, "driver_left")]
    assert reported == [0, 1, 0, 3]


def test_copies_are_dropped_and_counted(bench: Bench) -> None:
    came = ((0, STANDS), (1, STANDS), (1, STANDS + CLEAR), (0, STANDS))
    velocities = [
        published(bench.receive(datagram, port=port), "velocity") for port, datagram in came
    ]
    assert [len(each) for each in velocities] == [1, 0, 0, 1]
    assert bench.counters["other_port"] == 2


def test_what_no_vehicle_can_mean_is_dropped_and_counted(bench: Bench) -> None:
    out = bench.receive(b"nonsense", FRAMING.pack(VelocityReport(30_000, 0)))
    assert out.messages == []
    assert bench.link().rejected == {"no_magic": 1, "implausible": 1}
    assert bench.core.readiness.link.state == "never"


def link_lost(bench: Bench) -> None:
    out = bench.tick(NS_PER_S)
    assert "link_lost" in events(out)


def board_restarted(bench: Bench) -> None:
    bench.answer(DistanceReport(1000, 0))
    out = bench.answer(DistanceReport(0, 0))
    assert "board_restarted" in events(out)


@pytest.mark.parametrize("gap", [link_lost, board_restarted])
@pytest.mark.parametrize("first", [True, False])
def test_a_row_of_clear_samples_begins_anew_after_a_gap(
    bench: Bench, gap: Any, first: bool
) -> None:
    bench.receive(HIT if first else CLEAR, CLEAR, CLEAR, *[CLEAR] * (not first))
    bench.move(Command.BRAKE, judged=99, judged_boot=BOOT)
    gap(bench)
    assert pressed(bench.receive(CLEAR, CLEAR)) == []
    assert pressed(bench.receive(CLEAR)) == [False]
    gap(bench)
    assert bench.receive(HIT).hit is not None


@pytest.mark.parametrize("echoes", [True, False])
def test_a_board_that_restarts_disarms_at_once(bench: Bench, echoes: bool) -> None:
    if not echoes:
        sets = "bridge.require_switches=false", "bridge.unsafe_overrides=require_switches"
        bench = Bench(*sets)
    bench.arm()
    assert motions(bench.move(linear=0.3)) == [MotionKind.RUN]
    board_restarted(bench)
    assert motions(bench.move(linear=0.3)) == [MotionKind.STOP]
    assert bench.link().epoch == 1


# --- readiness ----------------------------------------------------------------------------------


def settings_asked(out: Output) -> int:
    """Return how many commands for the emergency brakes were sent."""
    kinds = commands.UltrasonicBrakeSet, commands.BumperBrakeSet
    return sum(isinstance(frame, kinds) for frame in frames(out))


def test_brakes_that_are_no_longer_echoed_inhibit_and_are_published(bench: Bench) -> None:
    bench.arm()
    reported: list[m.Switches] = []
    for _ in range(5):
        assert bench.core.readiness.ready
        bench.receive(STANDS)
        reported += published(bench.tick(NS_PER_S // 5), "switches")
    assert not bench.core.readiness.ready
    assert reported == [m.Switches(ultrasonic_brake=None, bumper_brake=None)]


@pytest.mark.parametrize("port", [0, 1])
@pytest.mark.parametrize(
    "off", [reports.UltrasonicBrakeReport(False), reports.BumperBrakeReport(False)]
)
def test_a_brake_that_is_off_disarms_at_once(bench: Bench, off: Frame, port: int) -> None:
    bench.arm()
    assert motions(bench.move(linear=0.3)) == [MotionKind.RUN]
    bench.receive(FRAMING.pack(off), port=port)
    assert motions(bench.move(linear=0.3)) == [MotionKind.STOP]


def test_a_gap_of_some_velocity_periods_sends_the_brakes_again_at_once(bench: Bench) -> None:
    """A board that restarts within 120 ms with counters near zero shows nothing else."""
    bench.arm()
    bench.receive(STANDS)
    assert settings_asked(bench.tick(60 * MS)) == 0
    bench.receive(STANDS)
    bench.now_ns += 61 * MS
    bench.receive(STANDS)
    assert settings_asked(bench.tick(0)) == 2
    assert bench.core.readiness.ready


@pytest.mark.parametrize(
    ("ultrasonic", "bumper", "ready"),
    [(None, None, True), (True, None, True), (False, None, False), (None, False, False)],
)
def test_a_firmware_without_echoes_is_driven_when_that_is_accepted(
    ultrasonic: bool | None, bumper: bool | None, ready: bool
) -> None:
    bench = Bench("bridge.require_switches=false", "bridge.unsafe_overrides=require_switches")
    readiness = bench.core.readiness
    assert not readiness.ready
    bench.receive(STANDS)
    for position, kind in (
        (ultrasonic, reports.UltrasonicBrakeReport), (bumper, reports.BumperBrakeReport),
    ):  # fmt: skip
        if position is not None:
            bench.answer(kind(position))
    assert readiness.ready is ready
    assert (readiness.waiting() == "") is ready
    assert settings_asked(bench.tick()), "the settings are requested in any case"
    readiness.want(None, False, bench.now_ns)
    assert not readiness.ready


# --- motions ------------------------------------------------------------------------------------


def test_only_the_first_jump_of_a_sender_is_an_event(bench: Bench) -> None:
    bench.arm()
    logged = [
        event
        for boot in (SAFETY, SAFETY, 2, 2)
        for event in events(bench.move(Command.STOP, seq=2**40, boot=boot))
    ]
    assert logged == ["seq_jump", "second_authority"]
    assert bench.counters["motion_seq_jumps"] == 2


@pytest.mark.parametrize("field", ["linear", "angular"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_number_that_is_not_finite_is_dropped_and_logged(
    bench: Bench, field: str, value: float
) -> None:
    bench.arm()
    fields: dict[str, Any] = {field: value}
    out = bench.move(**fields)
    assert out.sends == []
    assert "not finite" in out.warnings[0]
    assert bench.counters["motion_not_finite"] == 1


def test_a_brake_does_not_depend_on_numbers_that_are_not_finite(bench: Bench) -> None:
    bench.arm()
    out = bench.move(Command.BRAKE, linear=math.nan)
    assert motions(out) == [MotionKind.BREAK]


def test_an_emergency_stop_brakes_at_once_until_safety_has_latched_it(bench: Bench) -> None:
    bench.arm()
    bench.move(Command.RUN)
    assert motions(bench.core.estop(bench.now_ns)) == [MotionKind.BREAK]
    assert motions(bench.core.estop(bench.now_ns)) == []  # repeated until it is confirmed
    assert MotionKind.RUN not in motions(bench.move(Command.RUN, linear=0.5))
    bench.move(Command.BRAKE, estop=bench.now_ns)
    bench.move(Command.STOP)
    assert motions(bench.move(Command.RUN, linear=0.5)) == [MotionKind.RUN]


@pytest.mark.parametrize("command", [Command.STOP, Command.BRAKE])
def test_a_bridge_that_ends_does_not_take_a_brake_back(bench: Bench, command: Command) -> None:
    bench.arm()
    bench.move(command)
    kind = MotionKind.BREAK if command is Command.BRAKE else MotionKind.STOP
    assert motions(bench.core.stop(bench.now_ns)) == [kind]
    assert motions(bench.core.stop(bench.now_ns)) == [], "said once"


@pytest.mark.parametrize(("speed", "kind"), [(0, MotionKind.STOP), (300, MotionKind.BREAK)])
def test_the_last_frame_brakes_unless_the_vehicle_stands(
    bench: Bench, speed: int, kind: MotionKind
) -> None:
    bench.arm()
    bench.core.stop(bench.now_ns)
    assert not bench.core.motions.is_stopped(bench.now_ns)
    bench.now_ns += MS
    bench.answer(VelocityReport(speed, 0))
    assert bench.core.motions.is_stopped(bench.now_ns) is (speed == 0)
    assert motions(bench.core.exit(bench.now_ns)) == [kind]
    assert bench.core.motions.is_stopped(bench.now_ns + NS_PER_S + MS), "it waits no longer"


# --- calls --------------------------------------------------------------------------------------


def test_a_lamp_answers_with_the_boards_echo(bench: Bench) -> None:
    bench.arm()
    out = bench.core.led(m.LedRequest(channel=1, mode=0), "caller", bench.now_ns)
    assert isinstance(frames(out)[0], commands.LedSet)
    (answer,) = bench.answer(reports.LedReport(True)).answers
    assert (answer.caller, answer.reply, answer.refusal) == (
        "caller", m.Done(text="the lamp is set"), "",
    )  # fmt: skip


def test_a_lamp_that_the_board_does_not_echo_is_refused(bench: Bench) -> None:
    bench.arm()
    bench.core.led(m.LedRequest(channel=1, mode=0), "caller", bench.now_ns)
    (answer,) = bench.tick(NS_PER_S).answers
    assert answer.refusal == "the board did not echo within 0.5 s"
    (refused,) = bench.core.led(m.LedRequest(channel=1, mode=0), 2, bench.now_ns).answers
    assert refused.refusal == "the board is absent (link lost)"


def test_a_lamps_echo_that_nobody_waits_for_answers_nobody(bench: Bench) -> None:
    bench.arm()
    assert bench.answer(reports.LedReport(True)).answers == []


def test_ranges_are_published_in_metres(bench: Bench) -> None:
    bench.arm()
    (message,) = published(
        bench.receive(FRAMING.pack(reports.UltrasonicReport((1000, *(2500,) * 7)))), "ultrasonic"
    )
    assert message.ranges == (1.0, *(2.5,) * 7)
