"""The relay's core: what passes, when it brakes, and what ends that."""

import json
from collections.abc import Sequence

import pytest

from common.cli_args import VERSION as T2_VERSION
from services.relay import wire
from services.relay.core import (
    BOARD,
    BRAKE_PERIOD_NS,
    CLEAR_SAMPLES,
    LEASE_NS,
    PC,
    REPORT,
    REPORT_PERIOD_NS,
    VERSION,
    Relay,
    Send,
)
from tests.relay.frames import CLEAR, HIT, QUERY, RUN, STOP, ZERO

MS = 1_000_000
NOW = 1_000_000 * MS
BRAKES = [(BOARD, 0, wire.BRAKE), (BOARD, 1, wire.BRAKE)]


class Bench:
    """A relay, its time, and what it sent."""

    def __init__(self, *, passing: bool = True) -> None:
        self.relay = Relay(NOW)
        self.now_ns = NOW
        if passing:
            self.wait(0)
            assert self.pc(STOP) == [STOP]
            assert self.relay.braking == ""

    def pc(self, datagram: bytes, *, late_ns: int = 0, port: int = 0) -> list[bytes]:
        """Receive from the PC; return what goes to the board."""
        received_ns = self.now_ns - late_ns
        return to_board(self.relay.from_pc(datagram, port, received_ns, self.now_ns))

    def board(self, *datagrams: bytes, port: int = 0) -> list[bytes]:
        """Receive from the board; return what goes to the board."""
        sends: list[Send] = []
        for datagram in datagrams:
            made = self.relay.from_board(datagram, port, self.now_ns)
            assert made[-1] == (PC, port, datagram)
            sends += made[:-1]
        return to_board(sends)

    def wait(self, after_ns: int) -> list[bytes]:
        """Advance the time, and tick."""
        self.now_ns += after_ns
        return to_board(self.relay.tick(self.now_ns))


def to_board(sends: Sequence[Send]) -> list[bytes]:
    """Return what goes to the board; a BRAKE from both ports counts once."""
    return [datagram for to, port, datagram in sends if to == BOARD and not (
        datagram == wire.BRAKE and port == 1)]  # fmt: skip


def test_it_begins_with_brake_and_repeats_it_until_a_neutral_command() -> None:
    it = Bench(passing=False)
    assert it.relay.tick(NOW)[:2] == BRAKES
    assert it.wait(BRAKE_PERIOD_NS - 1) == []
    for _ in range(100):  # longer than any lease
        assert it.wait(BRAKE_PERIOD_NS) == [wire.BRAKE]
        assert it.pc(RUN) == []
    assert it.relay.braking == "start"
    assert it.pc(ZERO) == [ZERO]
    assert it.pc(RUN) == [RUN]
    assert it.relay.counters["to_board"] == 2
    assert it.wait(LEASE_NS) == []


@pytest.mark.parametrize("neutral", [STOP, ZERO, wire.BRAKE])
def test_the_lease_ends_after_200_ms_and_wants_a_neutral_command(neutral: bytes) -> None:
    it = Bench()
    it.now_ns += LEASE_NS
    assert it.pc(RUN) == [RUN]
    assert it.wait(LEASE_NS) == []
    assert it.wait(1) == [wire.BRAKE]
    assert (it.relay.braking, it.relay.counters["silent"]) == ("silent", 1)
    assert it.pc(RUN) == []
    assert it.wait(BRAKE_PERIOD_NS) == [wire.BRAKE]
    assert it.pc(neutral) == [neutral]
    assert it.pc(RUN) == [RUN]


def test_a_run_after_the_lease_does_not_pass_although_no_tick_was_between() -> None:
    it = Bench()
    it.now_ns += LEASE_NS + 1
    assert it.pc(RUN) == [wire.BRAKE]


def test_queries_renew_no_lease_and_always_pass() -> None:
    it = Bench()
    for _ in range(4):
        it.now_ns += LEASE_NS // 4
        assert it.pc(QUERY, port=1) == [QUERY]
    assert it.wait(1) == [wire.BRAKE]
    assert it.pc(QUERY) == [QUERY]
    assert it.relay.braking == "silent"


def test_the_lease_counts_from_the_arrival() -> None:
    it = Bench()
    assert it.pc(RUN, late_ns=LEASE_NS // 2) == [RUN]  # the newer STOP still counts
    assert it.wait(LEASE_NS) == []
    assert it.pc(RUN, late_ns=LEASE_NS) == [RUN]
    assert it.wait(1) == [wire.BRAKE]


@pytest.mark.parametrize("datagram", [RUN, STOP])
def test_what_waited_longer_than_the_lease_neither_passes_nor_releases(datagram: bytes) -> None:
    it = Bench()
    assert it.pc(datagram, late_ns=LEASE_NS + 1) == []
    it.wait(LEASE_NS + 1)
    assert it.pc(datagram, late_ns=LEASE_NS + 1) == []
    assert it.relay.braking == "silent"
    assert it.relay.counters["withheld"] == 2


def test_a_datagram_with_several_frames_counts_by_its_run() -> None:
    it = Bench(passing=False)
    it.wait(0)
    assert it.pc(STOP + RUN) == []
    assert it.pc(RUN + STOP) == []
    assert it.pc(QUERY + RUN) == []
    assert it.pc(QUERY + STOP) == [QUERY + STOP]
    assert it.pc(STOP + RUN) == [STOP + RUN]


@pytest.mark.parametrize("garbage", [RUN[:-1], RUN + b"\0", b"\0" + RUN, b"GS", bytes(13)])
def test_garbage_neither_passes_nor_renews(garbage: bytes) -> None:
    it = Bench()
    it.now_ns += LEASE_NS
    assert it.pc(garbage) == []
    assert it.wait(1) == [wire.BRAKE]
    assert it.pc(garbage) == []
    assert it.relay.braking == "silent"
    assert it.relay.counters["garbage"] == 2


def test_a_hit_brakes_before_it_passes_and_holds_until_a_neutral_command() -> None:
    it = Bench()
    assert it.pc(RUN) == [RUN]
    assert it.relay.from_board(HIT, 1, it.now_ns) == [*BRAKES, (PC, 1, HIT)]
    assert it.relay.braking == "hit"
    assert it.pc(RUN) == []
    assert it.wait(BRAKE_PERIOD_NS) == [wire.BRAKE]
    assert it.pc(wire.BRAKE) == [wire.BRAKE]
    assert it.pc(RUN) == [RUN]  # the held release, off the pressed bumper


def test_a_pc_that_dies_after_a_hit_is_braked_for() -> None:
    it = Bench()
    it.board(HIT)
    assert it.wait(LEASE_NS + 1) == [wire.BRAKE]
    assert it.relay.braking == "silent"


def test_only_a_hit_after_three_clear_samples_is_a_new_one() -> None:
    it = Bench()
    assert it.board(CLEAR, HIT) == [wire.BRAKE]
    it.pc(STOP)
    assert it.board(HIT, *[CLEAR] * (CLEAR_SAMPLES - 1), HIT) == []
    assert it.board(*[CLEAR] * (CLEAR_SAMPLES - 1), HIT) == []
    assert it.relay.braking == ""
    assert it.board(*[CLEAR] * CLEAR_SAMPLES, HIT) == [wire.BRAKE]


def test_copies_on_the_other_port_do_not_count_as_further_samples() -> None:
    it = Bench()
    it.board(HIT)
    it.pc(STOP)
    for _ in range(CLEAR_SAMPLES - 1):
        it.board(CLEAR)
        it.board(CLEAR, port=1)
    assert it.board(HIT, port=1) == []
    for port in (0, 1):  # hits on one port, clear on the other: pressed
        it.board(*[CLEAR] * (CLEAR_SAMPLES - 1), port=port)
        assert it.board(HIT, port=1 - port) == []


def test_after_200_ms_without_a_sample_a_hit_is_a_new_one() -> None:
    it = Bench()
    it.board(HIT)
    it.pc(STOP)
    it.now_ns += LEASE_NS
    it.pc(STOP)
    assert it.board(HIT) == []
    it.now_ns += LEASE_NS + 1
    it.pc(STOP)
    assert it.board(HIT) == [wire.BRAKE]


def test_a_clear_sample_after_a_gap_ends_a_press() -> None:
    it = Bench()
    it.board(HIT)
    it.now_ns += LEASE_NS + 1
    it.pc(STOP)
    it.board(CLEAR)
    assert it.board(HIT) == [wire.BRAKE]


def test_many_hits_in_one_datagram_are_one_brake() -> None:
    it = Bench()
    assert it.board((HIT + CLEAR * 3) * 50) == [wire.BRAKE]


def test_what_the_board_sends_passes_whatever_it_is() -> None:
    it = Bench(passing=False)
    for datagram in (b"", b"\0", b"GS" * 700, RUN):
        assert it.board(datagram) == []
    assert it.relay.counters["to_pc"] == 4
    assert it.pc(RUN) == [wire.BRAKE]


def test_a_report_ten_times_a_second_with_version_state_and_counters() -> None:
    it = Bench()
    assert [to for to, _, _ in it.relay.tick(NOW + REPORT_PERIOD_NS - 1)] == []
    it.relay.from_board(HIT, 0, NOW + 1)
    sends = it.relay.tick(NOW + REPORT_PERIOD_NS)
    (report,) = (json.loads(datagram) for to, port, datagram in sends if (to, port) == (REPORT, 0))
    assert report == {
        "version": T2_VERSION, "braking": "hit", "uptime": 0.1,
        "counters": {"repeats": 2, "to_board": 1, "hit": 1, "to_pc": 1},
    }  # fmt: skip
    assert VERSION == T2_VERSION


def test_a_report_beside_a_brake_is_sent_once() -> None:
    it = Bench()
    it.now_ns += LEASE_NS + 1
    assert [to for to, _, _ in it.relay.tick(it.now_ns)] == [BOARD, BOARD, REPORT]
    assert it.relay.brake(it.now_ns) == BRAKES


def test_one_port_is_enough() -> None:
    relay = Relay(NOW, 1)
    assert relay.tick(NOW)[:1] == BRAKES[:1]
    assert relay.from_board(CLEAR, 0, NOW) == [(PC, 0, CLEAR)]
