"""The relay by its reports: without it, or while it brakes, no RUN is obeyed."""

import json
from typing import Any

import pytest

from common.config import Sources, load
from common.errors import ConfigError
from common.motion import Command
from common.wire.commands import MotionKind
from services.bridge.config import BridgeConfig
from services.bridge.relay_status import SILENCE_NS
from services.relay.core import REPORT, Relay
from tests.bridge.core_fixture import MS, STANDS, Bench, events, motions

CONFIGURED = "board.relay_port=4010"


def report(braking: str = "", **fields: Any) -> bytes:
    usual = {"version": "0.1.0", "braking": braking, "uptime": 2.5, "counters": {"hit": 1}}
    return json.dumps(usual | fields).encode()


def take(bench: Bench, datagram: bytes) -> list[str]:
    """Take a report, and tick; return the events."""
    assert bench.core.readiness.relay.take(datagram, bench.now_ns)
    return events(bench.tick(0))


def armed() -> Bench:
    """Return a bridge that drives through a relay."""
    bench = Bench(CONFIGURED)
    assert bench.link().waiting.startswith("nothing received from the board")
    bench.receive(STANDS)
    assert bench.link().waiting.startswith("nothing received from the relay yet")
    assert take(bench, report()) == ["relay_up"]
    bench.arm()
    assert motions(bench.move(linear=0.3)) == [MotionKind.RUN]
    return bench


def test_without_the_setting_reports_change_nothing(bench: Bench) -> None:
    bench.arm()
    bench.core.readiness.relay.take(report("silent"), bench.now_ns)
    assert events(bench.tick(0)) == []
    assert bench.link().relay is None
    assert motions(bench.move(linear=0.3)) == [MotionKind.RUN]


@pytest.mark.parametrize("why", ["start", "silent", "hit"])
def test_while_the_relay_brakes_stop_is_sent_and_a_neutral_motion_re_arms(why: str) -> None:
    bench = armed()
    assert take(bench, report(why)) == ["relay_braking"]
    assert bench.link().waiting.startswith(f"the relay brakes: {why}")
    assert motions(bench.move(linear=0.3)) == [MotionKind.STOP]  # neutral to the relay
    assert take(bench, report(why)) == []
    assert take(bench, report()) == ["relay_up"]
    assert motions(bench.move(linear=0.3)) == [MotionKind.STOP]
    bench.move(Command.STOP)
    assert motions(bench.move(linear=0.3)) == [MotionKind.RUN]


def test_a_silent_relay_is_lost_after_five_reports_and_comes_back() -> None:
    bench = armed()
    take(bench, report())
    received_ns = bench.now_ns
    while bench.now_ns < received_ns + SILENCE_NS:
        bench.receive(STANDS)
        bench.tick(10 * MS)
    assert not bench.link().waiting.startswith("the relay is silent")
    bench.receive(STANDS)
    assert "relay_lost" in events(bench.tick(10 * MS))
    assert bench.link().waiting.startswith("the relay is silent")
    assert bench.link().relay.state == "lost"  # type: ignore[union-attr]
    assert motions(bench.move(linear=0.3)) == [MotionKind.STOP]
    assert take(bench, report()) == ["relay_up"]


def test_the_link_message_has_the_newest_report() -> None:
    bench = Bench(CONFIGURED)
    before = bench.link().relay
    assert before is not None
    assert (before.state, before.version, before.counters) == ("never", "", {})
    take(bench, report("hit"))
    after = bench.link().relay
    assert after is not None
    assert (after.state, after.version, after.braking) == ("up", "0.1.0", "hit")
    assert (after.uptime, after.counters) == (2.5, {"hit": 1})


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
    status = Bench(CONFIGURED).core.readiness.relay
    assert not status.take(datagram, 0)
    assert status.waiting == "nothing received from the relay yet"


def test_the_relays_own_report_is_valid() -> None:
    (own,) = (datagram for to, _, datagram in Relay(0).tick(0) if to == REPORT)
    bench = Bench(CONFIGURED)
    assert take(bench, own) == ["relay_braking"]


@pytest.mark.parametrize(
    ("sets", "text"),
    [
        (["board.relay_port=4003"], "relay_port is 4003, as port"),
        (["board.relay_port=65536"], "relay_port"),
        ([CONFIGURED, "wire.crc=xmodem"], r"board\.relay_port wants wire\.crc crc-16"),
        ([CONFIGURED, "wire.crc_covers=header_and_payload"], "over the payload"),
    ],
)
def test_a_setting_that_the_relay_cannot_meet_is_refused(sets: list[str], text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        load(BridgeConfig, Sources(environ={}, sets=sets))
