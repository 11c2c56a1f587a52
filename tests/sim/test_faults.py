from typing import Any, Literal

import pytest

from common.freshness import NS_PER_S
from sim.faults import QUEUE, Cable, Datagram
from sim.model import Line

MANY = [Datagram(bytes([k % 256, k // 256, 7]), 4002) for k in range(1000)]


def through(*datagrams: Datagram, **faults: Any) -> list[Datagram]:
    """Send them and return what arrives at once."""
    cable = Cable(1, Line(**faults))
    for datagram in datagrams:
        cable.put(datagram, 0)
    return cable.take(0)


def test_dropping_and_duplicating() -> None:
    arrived = through(*MANY, drop=0.25)
    assert 700 < len(arrived) < 800
    assert arrived == [datagram for datagram in MANY if datagram in arrived]
    assert through(*MANY[:2], duplicate=1.0) == [MANY[0], MANY[0], MANY[1], MANY[1]]


def test_corrupting_flips_one_to_three_bits() -> None:
    counts = {
        (int.from_bytes(before.payload, "big") ^ int.from_bytes(after.payload, "big")).bit_count()
        for before, after in zip(MANY, through(*MANY, corrupt=1.0), strict=True)
    }
    assert counts == {0, 1, 2, 3}  # the same bit twice is as before
    assert through(Datagram(b"", 4002), corrupt=1.0) == [Datagram(b"", 4002)]


@pytest.mark.parametrize(("port", "hit"), [("first", 4002), ("second", 4001)])
def test_faults_may_be_those_of_one_port(port: Literal["first", "second"], hit: int) -> None:
    cable = Cable(1, Line(port=port, drop=1.0), (4002, 4001))
    for each in (4002, 4001):
        cable.put(Datagram(b"a", each), 0)
    assert [d.port for d in cable.take(0)] == [each for each in (4002, 4001) if each != hit]


def test_a_delayed_one_is_not_there_before_its_time() -> None:
    cable = Cable(1, Line(delay=0.5))
    cable.put(MANY[0], 0)
    assert cable.take(NS_PER_S // 2 - 1) == []
    assert cable.take(NS_PER_S // 2) == [MANY[0]]
    assert cable.due_ns is None
    cable.faults = Line(jitter=1.0)
    for datagram in MANY:
        cable.put(datagram, 0)
    assert 400 < len(cable.take(NS_PER_S // 2)) < 600
    assert len(cable.take(NS_PER_S - 1)) > 400


def test_a_thin_cable_lets_one_after_the_other_through() -> None:
    cable = Cable(1)
    cable.faults = Line(rate=8e3, delay=1.0)  # a byte in a millisecond
    for datagram in MANY[:2]:
        cable.put(datagram, 0)
    assert cable.take(1_003_000_000 - 1) == []
    assert cable.take(1_003_000_000) == [MANY[0]]
    assert cable.take(1_006_000_000) == [MANY[1]]
    cable.put(MANY[2], 2 * NS_PER_S)  # it has been free meanwhile
    assert cable.due_ns == 3_003_000_000


def test_what_the_queue_of_a_thin_cable_does_not_hold_is_lost() -> None:
    cable = Cable(1, Line(rate=8e6))
    big = [Datagram(bytes([k]) * (QUEUE // 2 - 24), 4002) for k in range(4)]
    for datagram in big[:3]:
        cable.put(datagram, 0)
    cable.put(big[3], NS_PER_S // 25)  # a microsecond for a byte: one has left
    assert cable.take(NS_PER_S) == [big[0], big[1], big[3]]
