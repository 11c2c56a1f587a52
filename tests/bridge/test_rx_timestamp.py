"""The kernel's stamp on the monotonic clock, and what becomes of it when the wall clock is set."""

import struct

import pytest

from services.bridge.rx_timestamp import SO_TIMESTAMPNS, Receipt, WallClock, kernel_timestamp

AHEAD_NS = 1_700_000_000_000_000_000  # wall clock less monotonic clock
NOW = 5_000_000_000


def look(clock: WallClock, now_ns: int, ahead_ns: int, width_ns: int = 100) -> None:
    """Read both clocks as the sockets do, the wall clock in the middle."""
    half_ns = width_ns // 2
    clock.update(now_ns - half_ns, now_ns + ahead_ns, now_ns + half_ns)


def test_a_stamp_becomes_monotonic_time() -> None:
    clock = WallClock()
    look(clock, NOW, AHEAD_NS)
    assert clock.monotonic_ns(NOW + AHEAD_NS - 700, NOW) == NOW - 700
    assert clock.monotonic_ns(NOW + AHEAD_NS, NOW) == NOW
    assert clock.steps == 0


def test_without_a_look_no_stamp_is_believed() -> None:
    assert WallClock().monotonic_ns(NOW, NOW) is None


def test_a_stamp_of_the_future_is_not_believed() -> None:
    clock = WallClock()
    look(clock, NOW, AHEAD_NS)
    assert clock.monotonic_ns(NOW + AHEAD_NS + 1, NOW) is None


def test_the_narrowest_look_counts() -> None:
    clock = WallClock()
    # Held up for 50 ms right after the wall clock was read, then right before.
    clock.update(NOW, NOW + AHEAD_NS, NOW + 50_000_000)
    assert clock.monotonic_ns(NOW + AHEAD_NS, NOW + S) == NOW + 25_000_000
    look(clock, NOW + S, AHEAD_NS, 100)
    clock.update(NOW + 2 * S, NOW + 2 * S + 50_000_000 + AHEAD_NS, NOW + 2 * S + 50_000_000)
    assert clock.monotonic_ns(NOW + AHEAD_NS, NOW + S) in range(NOW - 50, NOW + 51)
    assert clock.steps == 0


S = 1_000_000_000


@pytest.mark.parametrize("step_ns", [3 * S, -3 * S, 2_000, -2_000])
def test_after_the_clock_was_set_no_stamp_of_before_is_believed(step_ns: int) -> None:
    clock = WallClock()
    look(clock, NOW, AHEAD_NS)
    set_ns = NOW + S
    look(clock, set_ns, AHEAD_NS + step_ns)
    assert clock.steps == 1
    # In the queue since before: stamped by the clock of then, read by the one of now.
    old = set_ns - 1_000 + AHEAD_NS
    now_ns = set_ns + 100
    assert clock.monotonic_ns(old, now_ns) is None
    new = set_ns + 60 + AHEAD_NS + step_ns
    assert clock.monotonic_ns(new, now_ns) == set_ns + 60
    look(clock, now_ns, AHEAD_NS + step_ns)
    assert clock.steps == 1


def test_a_stamp_at_the_very_moment_of_the_step_is_believed() -> None:
    clock = WallClock()
    clock.update(0, AHEAD_NS, 0)
    clock.update(NOW, NOW, NOW)
    assert clock.monotonic_ns(NOW, NOW) == NOW
    assert clock.monotonic_ns(NOW - 1, NOW) is None


def test_clocks_that_disagree_by_nanoseconds_were_not_set() -> None:
    clock = WallClock()
    clock.update(NOW, NOW + AHEAD_NS, NOW)
    clock.update(NOW, NOW + AHEAD_NS + 1_000, NOW)
    assert clock.steps == 0
    assert clock.monotonic_ns(NOW + AHEAD_NS, NOW) == NOW  # what was known stays
    clock.update(NOW, NOW + AHEAD_NS + 1_001, NOW)
    assert clock.steps == 1


def test_the_stamp_is_found_among_the_ancillary_data() -> None:
    stamp = struct.pack("=qq", 1_700_000_000, 5)
    assert kernel_timestamp([]) is None
    assert kernel_timestamp([(1, 99, stamp)]) is None
    assert kernel_timestamp([(1, SO_TIMESTAMPNS, stamp[:8])]) is None
    assert kernel_timestamp([(1, 99, b""), (1, SO_TIMESTAMPNS, stamp)]) == 1_700_000_000_000_000_005


def test_a_datagram_came_when_the_kernel_says_or_else_when_it_was_read() -> None:
    assert Receipt(3, 5).earliest_ns == 3
    assert Receipt(None, 5).earliest_ns == 5
