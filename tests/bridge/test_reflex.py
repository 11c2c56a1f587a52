"""Hits of the bumper at the bridge's core: the reflex, both UDP ports, and the acknowledgment."""

import pytest

from common.motion import Command
from common.wire.commands import MotionKind
from common.wire.frame import HEADER
from common.wire.framing import crc_function
from common.wire.reports import BumperReport
from tests.bridge.core_fixture import BOOT, CLEAR, HIT, NOW, STANDS, Bench, events, motions, pressed


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
    assert all(motions(out) for out in outs)
