"""Hang detection with a simulated clock."""

from cli.run.router_attempts import MISSES, STALL_NS, Attempts

TICK_NS = 100_000_000
DEADLINE_NS = 1_000_000_000
PERIOD_NS = DEADLINE_NS // 2


def hung_at(attempts: Attempts, begin_ns: int, end_ns: int) -> int | None:
    """Check at every tick, begin due attempts; return the time of the detected hang."""
    for now_ns in range(begin_ns, end_ns, TICK_NS):
        attempts.begin(now_ns)
        if attempts.hung(now_ns):
            return now_ns
    return None


def test_an_attempt_begins_every_period() -> None:
    attempts = Attempts(7, DEADLINE_NS)
    assert attempts.begin(7) == 1
    assert attempts.begin(7 + PERIOD_NS - 1) is None
    assert attempts.begin(7 + PERIOD_NS) == 2
    assert attempts.begin(7 + 3 * PERIOD_NS) == 3
    assert attempts.begin(7 + 4 * PERIOD_NS - 1) is None


def test_no_answer_is_a_hang_within_two_seconds() -> None:
    attempts = Attempts(0, DEADLINE_NS)
    hung_ns = hung_at(attempts, 0, 10 * DEADLINE_NS)
    assert hung_ns == DEADLINE_NS + (MISSES - 1) * PERIOD_NS
    assert hung_ns + PERIOD_NS <= 2_000_000_000  # the hang may begin right after an attempt


def test_one_miss_is_not_a_hang() -> None:
    attempts = Attempts(0, DEADLINE_NS)
    attempts.begin(0)
    attempts.begin(PERIOD_NS)
    attempts.hung(PERIOD_NS)
    assert attempts.end(2, True)
    assert not attempts.hung(DEADLINE_NS)  # the first is missed, and the only one
    attempts.begin(DEADLINE_NS)
    assert attempts.end(3, True)
    attempts.begin(DEADLINE_NS + PERIOD_NS)
    assert not attempts.end(4, False)
    assert not attempts.hung(DEADLINE_NS + PERIOD_NS)


def test_refusals_count_at_once() -> None:
    attempts = Attempts(0, DEADLINE_NS)
    for number in range(1, MISSES + 1):
        assert not attempts.hung(0)
        attempts.begin(number * PERIOD_NS)
        assert not attempts.end(number, False)
    attempts = Attempts(0, DEADLINE_NS)
    attempts.begin(0)
    attempts.end(1, False)
    attempts.begin(PERIOD_NS)
    attempts.end(2, False)
    assert attempts.hung(PERIOD_NS)


def test_a_late_answer_does_not_count() -> None:
    attempts = Attempts(0, DEADLINE_NS)
    hung_at(attempts, 0, DEADLINE_NS + 1)
    assert not attempts.end(1, True)
    assert not attempts.end(99, True)


def test_the_deadline_is_exact() -> None:
    attempts = Attempts(0, DEADLINE_NS)
    attempts.begin(0)
    attempts.end(1, False)
    attempts.begin(PERIOD_NS)
    attempts.hung(PERIOD_NS)
    attempts.hung(2 * PERIOD_NS)
    assert not attempts.hung(PERIOD_NS + DEADLINE_NS - 1)
    assert attempts.hung(PERIOD_NS + DEADLINE_NS)


def test_a_stalled_probe_forgives_once() -> None:
    attempts = Attempts(0, DEADLINE_NS)
    attempts.begin(0)
    attempts.begin(PERIOD_NS)
    attempts.hung(PERIOD_NS)
    after_ns = PERIOD_NS + STALL_NS + DEADLINE_NS
    assert not attempts.hung(after_ns)
    assert not attempts.end(1, True), "begun before the stall: it counts neither way"
    assert hung_at(attempts, after_ns, after_ns + 10 * DEADLINE_NS) is not None


def test_a_starved_probe_still_acts() -> None:
    attempts = Attempts(0, DEADLINE_NS)
    hung_ns = None
    for now_ns in range(0, 20 * DEADLINE_NS, STALL_NS + 1):
        attempts.begin(now_ns)
        if attempts.hung(now_ns):
            hung_ns = now_ns
            break
    assert hung_ns is not None
    assert hung_ns < 4 * DEADLINE_NS


def test_an_answer_allows_the_next_forgiveness() -> None:
    attempts = Attempts(0, DEADLINE_NS)
    attempts.hung(STALL_NS + 1)
    attempts.begin(STALL_NS + 1)
    attempts.end(1, True)
    attempts.begin(2 * STALL_NS + 1)
    attempts.end(2, False)
    attempts.begin(3 * STALL_NS + 1)
    attempts.end(3, False)
    assert not attempts.hung(2 * STALL_NS + 2 + STALL_NS)


def test_checks_at_the_stall_limit_forgive_nothing() -> None:
    attempts = Attempts(0, DEADLINE_NS)
    for turn in range(1, MISSES + 1):
        attempts.begin(turn * STALL_NS)
        attempts.end(turn, False)
        assert attempts.hung(turn * STALL_NS) is (turn == MISSES)


def test_a_longer_deadline() -> None:
    attempts = Attempts(0, 10 * DEADLINE_NS)
    assert attempts.begin(0) == 1
    assert attempts.begin(10 * PERIOD_NS - 1) is None
    hung_ns = hung_at(attempts, TICK_NS, 30 * DEADLINE_NS)
    assert hung_ns == 15 * DEADLINE_NS
