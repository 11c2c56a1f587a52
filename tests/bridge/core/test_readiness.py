"""Readiness: the link, the board's emergency brakes, and the relay."""

import json
from typing import Any

import pytest

from common.freshness import NS_PER_S
from common.motion import STOP
from common.wire import reports
from common.wire.commands import BumperBrakeSet, MotionKind, UltrasonicBrakeSet
from services.bridge.core.brakes import AGAIN_NS, ASK_NS, UNCONFIRMED, Brake
from services.bridge.core.output import Event, Output
from services.bridge.core.relay_status import RELAY_SILENCE_NS, RelayStatus
from services.relay.core import REPORT, Relay
from t2 import messages as m
from t2.messages import Phrase
from tests.bridge.core.core_fixture import MS, STANDS, Bench, events, frames, motions, published

SILENCE = 200 * MS
CONFIGURED = "board.relay_port=4010"
WITHOUT_ECHOES = "board.require_switches=false", "unsafe_overrides=board.require_switches"


@pytest.fixture
def bench() -> Bench:
    return Bench()


# --- the link -------------------------------------------------------------------------------------


def link_up(before: str) -> Event:
    return Event("link_up", "info", {"before": before})


def of_type(kind: type[Event], outputs: list[Output]) -> list[Output]:
    return [output for output in outputs if isinstance(output, kind)]


def test_a_restart_of_the_board_is_an_event(bench: Bench) -> None:
    bench.arm()
    out = bench.answer(reports.DistanceReport(0, 0))
    assert of_type(Event, out) == [Event("board_restarted", "warning", {"epoch": 1})]
    assert settings_sent(bench.tick(0)) == 2
    bench.answer(reports.DistanceReport(1000, 0), reports.DistanceReport(0, 0))
    assert bench.core.readiness.epoch == 2


@pytest.mark.parametrize(("age", "state"), [(SILENCE, "up"), (SILENCE + 1, "lost")])
def test_silence_loses_the_link(bench: Bench, age: int, state: str) -> None:
    readiness = bench.core.readiness
    bench.tick(9 * NS_PER_S)
    assert bench.link().state == "never"
    assert bench.link().waiting == "Nothing received from the board yet on UDP port 4002, 4001."
    assert bench.receive(STANDS)[-1] == link_up("never")
    up_ns = bench.now_ns
    bench.now_ns += 60 * MS
    assert events(bench.receive(STANDS)) == []
    assert (readiness.up_ns, readiness.gap_ns) == (up_ns, 0)
    lost = [Event("link_lost", "error")]
    assert of_type(Event, bench.tick(age)) == ([] if state == "up" else lost)
    assert bench.link().state == state
    if state == "lost":
        assert events(bench.tick(age)) == []
        assert (bench.link().waiting, bench.link().state) == (
            "The link to the board is lost.",
            "lost",
        )
        assert bench.receive(STANDS)[-1] == link_up("lost")
        assert (readiness.up_ns, readiness.gap_ns) == (bench.now_ns, 0)


# --- one brake ------------------------------------------------------------------------------------


def confirmed(on: bool = True) -> Brake:
    brake = Brake(BumperBrakeSet)
    brake.on_confirmation(on)
    return brake


def sends(brake: Brake, count: int, now_ns: int = NS_PER_S) -> Brake:
    """Send its command so often."""
    for number in range(count):
        assert brake.due(now_ns + number * AGAIN_NS)
    return brake


def test_it_is_sent_until_confirmed_and_then_again_and_again() -> None:
    brake = Brake(UltrasonicBrakeSet)
    due_ns = NS_PER_S
    for answer, wait_ns in ((None, ASK_NS), (False, ASK_NS), (True, AGAIN_NS), (None, AGAIN_NS)):
        assert brake.due(due_ns) == UltrasonicBrakeSet(True)
        if answer is not None:
            brake.on_confirmation(answer)
        assert brake.settled is bool(brake.position)
        assert brake.due(due_ns + wait_ns - 1) is None
        due_ns += wait_ns


def test_an_operator_may_switch_it_off_until_the_board_returns() -> None:
    brake = confirmed()
    brake.want(False, NS_PER_S)
    assert (brake.position, brake.settled, brake.assumed_on) == (None, False, False)
    assert brake.due(NS_PER_S) == BumperBrakeSet(False)
    brake.on_confirmation(False)
    assert (brake.position, brake.settled) == (False, True)
    brake.on_return(2 * NS_PER_S)
    assert (brake.wanted, brake.position, brake.since_ns) == (True, None, 2 * NS_PER_S)
    assert brake.due(2 * NS_PER_S) == BumperBrakeSet(True)


def test_an_on_counts_for_five_sends_and_an_off_until_an_on() -> None:
    brake = confirmed()
    for second in range(1, 9):
        assert sends(brake, UNCONFIRMED, second * NS_PER_S).position is True
        brake.on_confirmation(True)
    assert sends(brake, UNCONFIRMED + 1, 9 * NS_PER_S).position is None
    assert brake.assumed_on, "enough where the settings accept that"
    assert sends(confirmed(False), 3 * UNCONFIRMED).position is False


# --- both brakes ----------------------------------------------------------------------------------


def settings_sent(outputs: list[Output]) -> int:
    """Return how many commands for the emergency brakes were sent."""
    kinds = UltrasonicBrakeSet, BumperBrakeSet
    return sum(isinstance(frame, kinds) for frame in frames(outputs))


def test_a_gap_of_some_velocity_periods_sends_the_brakes_again_at_once(bench: Bench) -> None:
    """A board that restarts within 120 ms with counters near zero shows nothing else."""
    bench.arm()
    bench.receive(STANDS)
    assert settings_sent(bench.tick(60 * MS)) == 0
    bench.receive(STANDS)
    bench.now_ns += 61 * MS
    bench.receive(STANDS)
    assert settings_sent(bench.tick(0)) == 2
    assert bench.core.readiness.ready
    assert bench.core.readiness.gap_ns == bench.now_ns


def test_without_a_board_no_brake_is_sent(bench: Bench) -> None:
    assert settings_sent(bench.tick(NS_PER_S)) == 0


@pytest.mark.parametrize(
    ("ultrasonic", "bumper", "ready", "accepted"),
    [
        (None, None, False, True),
        (True, None, False, True),
        (True, True, True, True),
        (False, True, False, False),
        (None, False, False, False),
    ],
)
def test_both_must_be_confirmed_on_unless_the_settings_accept_another_firmware(
    ultrasonic: bool | None, bumper: bool | None, ready: bool, accepted: bool
) -> None:
    for bench, expected in ((Bench(), ready), (Bench(*WITHOUT_ECHOES), accepted)):
        readiness = bench.core.readiness
        assert not readiness.ready
        bench.receive(STANDS)
        for kind, on in (
            (reports.UltrasonicBrakeReport, ultrasonic), (reports.BumperBrakeReport, bumper),
        ):  # fmt: skip
            if on is not None:
                bench.answer(kind(on))
        assert readiness.ready is expected
        assert (readiness.waiting() == ()) is expected
        assert settings_sent(bench.tick()), "they are sent in any case"
        readiness.bumper.want(False, bench.now_ns)
        assert not readiness.ready


def test_a_board_without_echoes_is_reported_once_with_the_setting_that_helps(bench: Bench) -> None:
    bench.receive(STANDS)
    hint = " A firmware that confirms nothing needs board.require_switches = false."
    for _ in range(25):
        bench.receive(STANDS)
        assert events(bench.tick(20 * MS)) == []
        assert hint not in bench.link().waiting
    bench.receive(STANDS)
    text = "The board's emergency brakes are not both on and confirmed."
    unverified = Event("switches_unverified", "error")
    assert of_type(Event, bench.tick(1)) == [unverified]
    assert bench.link().waiting.startswith(f"{text}{hint}")
    assert events(bench.tick(20 * MS)) == []
    bench.answer(reports.BumperBrakeReport(False))
    assert hint not in bench.link().waiting


def test_each_change_is_published(bench: Bench) -> None:
    bench.receive(STANDS)
    assert published(bench.tick(), "switches") == []
    for frame, count in (
        (reports.BumperBrakeReport(True), 1), (reports.BumperBrakeReport(True), 0),
        (reports.UltrasonicBrakeReport(True), 1), (reports.BumperBrakeReport(False), 1),
    ):  # fmt: skip
        assert len(published(bench.answer(frame), "switches")) == count


# --- the relay ------------------------------------------------------------------------------------


def report(braking: str = "", **fields: Any) -> bytes:
    usual = {"version": "0.1.0", "braking": braking, "uptime": 2.5, "counters": {"hit": 1}}
    return json.dumps(usual | fields).encode()


UP = Event("relay_up", "info")
LOST = Event("relay_lost", "error")


def braking(why: str) -> Event:
    return Event(
        "relay_braking",
        "warning",
        {"reason": why},
        (Phrase("relay.brakes", {"reason": f"relay_{why}"}),),
    )


def take(bench: Bench, datagram: bytes) -> list[Output]:
    """Take a report, and tick; return the events."""
    bench.core.relay_report(datagram, bench.now_ns)
    assert not bench.core.rejected
    return of_type(Event, bench.tick(0))


def armed() -> Bench:
    """Return a bridge that drives through a relay."""
    bench = Bench(CONFIGURED)
    assert of_type(Event, bench.tick()) == []
    assert bench.link().waiting.startswith("Nothing received from the board")
    bench.receive(STANDS)
    assert bench.link().waiting.startswith("Nothing received from the relay yet.")
    assert take(bench, report()) == [UP]
    bench.arm()
    assert bench.core.readiness.waiting() == ()
    assert motions(bench.move(linear=0.3)) == [MotionKind.RUN]
    return bench


def test_without_the_setting_reports_change_nothing(bench: Bench) -> None:
    bench.arm()
    assert take(bench, report("silent")) == []
    assert bench.link().relay is None
    assert motions(bench.move(linear=0.3)) == [MotionKind.RUN]


@pytest.mark.parametrize("why", ["start", "silent", "hit"])
def test_while_the_relay_brakes_stop_is_sent_and_a_neutral_motion_re_arms(why: str) -> None:
    bench = armed()
    assert take(bench, report(why)) == [braking(why)]
    assert bench.link().waiting.startswith("The relay brakes (")
    assert motions(bench.move(linear=0.3)) == [MotionKind.STOP]  # neutral to the relay
    assert take(bench, report(why)) == []
    assert take(bench, report()) == [UP]
    assert motions(bench.move(linear=0.3)) == [MotionKind.STOP]
    bench.move(STOP)
    assert motions(bench.move(linear=0.3)) == [MotionKind.RUN]


def test_a_silent_relay_is_lost_after_five_reports_and_comes_back() -> None:
    bench = armed()
    take(bench, report())
    received_ns = bench.now_ns
    while bench.now_ns < received_ns + RELAY_SILENCE_NS:
        bench.receive(STANDS)
        bench.tick(10 * MS)
    assert not bench.link().waiting.startswith("The relay is silent.")
    bench.receive(STANDS)
    assert LOST in bench.tick(10 * MS)
    assert bench.link().waiting.startswith("The relay is silent.")
    assert bench.link().relay.state == "lost"  # type: ignore[union-attr]
    assert motions(bench.move(linear=0.3)) == [MotionKind.STOP]
    assert take(bench, report()) == [UP]


def test_the_link_message_has_the_newest_report() -> None:
    bench = Bench(CONFIGURED)
    nothing = m.Relay(state="never", version="", braking="", uptime=0.0, counters={})
    assert bench.link().relay == nothing
    take(bench, report("hit"))
    assert bench.link().relay == m.Relay(
        state="up", version="0.1.0", braking="hit", uptime=2.5, counters={"hit": 1}
    )


@pytest.mark.parametrize(
    "datagram",
    [
        b"x",
        b"{}",
        b"[]",
        b"\xff",
        report(counters=1),
        report(version=None),
        report(version="?").replace(b"?", b"\xff"),
        b'{"x":' + b"[" * 2000,
        report(counters={"hit": 2**64}),
        report(counters={"hit": -1}),
        report(braking="x" * 201),  # as part of the link message it would stop the vehicle
    ],
)
def test_an_invalid_report_is_refused(datagram: bytes) -> None:
    status = RelayStatus(required=True)
    assert not status.take(datagram, 0)
    assert status.waiting == (Phrase("relay.never"),)


def test_the_relays_own_report_is_valid() -> None:
    (own,) = (datagram for to, _, datagram in Relay(0).tick(0) if to == REPORT)
    assert take(Bench(CONFIGURED), own) == [braking("start")]
