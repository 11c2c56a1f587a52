"""The bridge's core through its entries: what each input leads to."""

import math
from collections import Counter
from typing import Any

import pytest

from common import messages as m
from common.config import Sources, load
from common.freshness import NS_PER_S
from common.motion import Command
from common.wire import commands, reports
from common.wire.commands import TO_BOARD, MotionCommand, MotionKind
from common.wire.frame import HEADER, Frame, Side
from common.wire.framing import Framing, Received, crc_function
from common.wire.reports import BumperReport, DistanceReport, DriverReport, VelocityReport
from services.bridge.config import BridgeConfig
from services.bridge.core import Core
from services.bridge.output import Output

MS = NS_PER_S // 1000
NOW = 1_000 * NS_PER_S
BOOT, SAFETY = 7, 1

FRAMING = Framing()
HIT, CLEAR, STANDS = map(
    FRAMING.pack, (BumperReport(True), BumperReport(False), VelocityReport(0, 0))
)


class Bench:
    """A core and its output so far."""

    def __init__(self, *sets: str) -> None:
        self.counters: Counter[str] = Counter()
        config = load(BridgeConfig, Sources(environ={}, sets=list(sets))).config
        self.core = Core(config, BOOT, self.counters, NOW)
        self.now_ns = NOW
        self.seq = 0
        self.outs: list[Output] = [self.core.start()]

    def receive(self, *datagrams: bytes, port: int = 0) -> Output:
        """Pass datagrams to the core as the shell does; return the combined output."""
        made = Output()
        for datagram in datagrams:
            hit = self.core.reflex(datagram)
            outs = []
            if hit is not None:
                made.sends.append(hit.brake)
                outs.append(self.core.hit(hit, self.now_ns))
            reported = hit is not None
            outs.append(self.core.datagram(datagram, port, self.now_ns, reported=reported))
            for out in outs:
                made.sends += out.sends
                made.messages += out.messages
                made.events += out.events
                made.answers += out.answers
                made.hit = made.hit or out.hit
        self.outs.append(made)
        return made

    def answer(self, *frames: Frame, port: int = 0) -> Output:
        """Receive these frames, one datagram for each."""
        return self.receive(*map(FRAMING.pack, frames), port=port)

    def tick(self, after_ns: int = 10 * MS, send_errors: int = 0) -> Output:
        """Advance the time, and tick."""
        self.now_ns += after_ns
        out = self.core.tick(self.now_ns, send_errors)
        self.outs.append(out)
        return out

    def move(self, command: Command = Command.RUN, linear: float = 0.0, **fields: Any) -> Output:
        """Receive a motion from safety."""
        self.seq += 1
        values = {"seq": self.seq, "boot": SAFETY, "linear": linear} | fields
        out = self.core.motion(m.Motion(command=command, **values), self.now_ns, self.now_ns)
        self.outs.append(out)
        return out

    def arm(self) -> None:
        """Receive all answers and echoes of the board, then a stop from safety."""
        echoes = reports.UltrasonicBrakeReport(True), reports.BumperBrakeReport(True)
        self.answer(VelocityReport(0, 0), BumperReport(False), DistanceReport(1000, 0), *echoes)
        self.receive(CLEAR, CLEAR, CLEAR)
        self.tick()
        self.move(Command.STOP)
        assert self.link().waiting == ""

    def link(self) -> m.Link:
        """Return the link message of now."""
        (message,) = published(self.core.link(self.now_ns, 0), "link")
        assert isinstance(message, m.Link)
        return message


def frames(out: Output) -> list[Frame]:
    """Return what was sent, read as the board reads it."""
    parts = [part for send in out.sends for part in FRAMING.read(send.datagram, TO_BOARD)]
    assert all(isinstance(part, Received) for part in parts)
    return [part.frame for part in parts if isinstance(part, Received)]


def motions(out: Output) -> list[MotionKind]:
    """Return the motion commands that were sent."""
    return [frame.kind for frame in frames(out) if isinstance(frame, MotionCommand)]


def published(out: Output, stream: str) -> list[Any]:
    """Return the messages of one stream."""
    return [message for name, message, _ in out.messages if name == stream]


def pressed(out: Output) -> list[bool]:
    """Return the contents of the bumper messages."""
    return [message.pressed for message in published(out, "bumper")]


def events(out: Output) -> list[str]:
    """Return the names of the events."""
    return [event.name for event in out.events]


@pytest.fixture
def bench() -> Bench:
    return Bench()


# --- the reflex ---------------------------------------------------------------------------------


def test_the_first_frame_is_a_stop(bench: Bench) -> None:
    assert motions(bench.outs[0]) == [MotionKind.STOP]


@pytest.mark.parametrize("datagram", [HIT, STANDS + HIT, HIT + STANDS, HIT + HIT])
def test_a_hit_is_braked_for_once_alone_in_its_datagram_or_not(
    bench: Bench, datagram: bytes
) -> None:
    bench.receive(CLEAR, CLEAR, CLEAR)
    out = bench.receive(datagram, HIT, HIT)
    assert motions(out) == [MotionKind.BREAK]
    assert out.hit == 2
    assert events(out).count("contact") == 1
    assert bench.core.motions.lease.hit == 2


def test_a_hit_that_the_reflex_did_not_see_is_braked_for_all_the_same(bench: Bench) -> None:
    out = bench.core.datagram(HIT, 0, NOW, reported=False)
    assert motions(out) == [MotionKind.BREAK]
    assert out.hit == 1


def hit_of(byte: int) -> bytes:
    """Return a datagram of a pressed bumper with this byte."""
    payload = bytes((byte,))
    return HEADER.pack(BumperReport.OPENING, crc_function("crc-16")(payload)) + payload


@pytest.mark.parametrize("byte", [1, 2, 0x80, 0xFF])
@pytest.mark.parametrize("form", ["alone", "behind", "before"])
def test_a_hit_on_the_other_port_is_braked_for_at_once(bench: Bench, byte: int, form: str) -> None:
    hit = hit_of(byte)
    datagram = {"alone": hit, "behind": STANDS + hit, "before": hit + CLEAR}[form]
    bench.receive(CLEAR, CLEAR, CLEAR)
    out = bench.receive(datagram, datagram, port=1)
    assert motions(out) == [MotionKind.BREAK]
    assert pressed(out)[0]
    assert bench.core.motions.lease.hit is not None
    assert pressed(bench.receive(CLEAR, CLEAR, CLEAR, CLEAR)) == [], "the hit's port is active"


@pytest.mark.parametrize("first", [0, 1])
def test_a_hit_that_comes_to_both_ports_is_published_once(bench: Bench, first: int) -> None:
    out = bench.receive(HIT, port=first)
    assert pressed(out) + pressed(bench.receive(HIT, port=1 - first)) == [True]


def test_while_one_port_shows_a_hit_clear_samples_of_the_other_do_not_count(bench: Bench) -> None:
    bench.receive(HIT)
    for _ in range(5):
        bench.receive(CLEAR)
        bench.receive(HIT, port=1)
    bench.move(Command.BRAKE, judged=99, judged_boot=BOOT)
    assert pressed(bench.receive(CLEAR)) == [True]


def test_a_short_hit_is_reported_until_safety_has_judged_it(bench: Bench) -> None:
    assert pressed(bench.receive(HIT, *[CLEAR] * 5)) == [True] * 6
    bench.move(Command.BRAKE, judged=1, judged_boot=BOOT)
    assert pressed(bench.receive(CLEAR)) == [False]


@pytest.mark.parametrize(("command", "is_judged"), [(Command.STOP, False), (Command.BRAKE, True)])
def test_only_a_brake_is_the_judged_stop(bench: Bench, command: Command, is_judged: bool) -> None:
    hit = bench.receive(HIT).hit
    assert hit is not None
    outs = [bench.move(command, judged=seq, judged_boot=BOOT) for seq in (hit - 1, hit, hit)]
    assert [out.acked for out in outs] == [False, is_judged, False]
    assert all(out.obeyed for out in outs)


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


def test_a_board_that_restarts_disarms_at_once(bench: Bench) -> None:
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
    assert (out.sends, out.obeyed) == ([], False)
    assert "not finite" in out.warnings[0]
    assert bench.counters["motion_not_finite"] == 1


def test_a_brake_does_not_depend_on_numbers_that_are_not_finite(bench: Bench) -> None:
    bench.arm()
    out = bench.move(Command.BRAKE, linear=math.nan)
    assert (motions(out), out.obeyed) == ([MotionKind.BREAK], True)


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
