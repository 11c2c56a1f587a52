"""What an operator saw: only in a snapshot that is known and young enough."""

import pytest

from common.freshness import NS_PER_S
from services.dashboard.snapshot_log import KEPT, Snapshots
from tests.factories import safety_state

STATE = safety_state(heartbeat=5)
LIMIT_S = 1.0


@pytest.fixture
def snapshots() -> Snapshots:
    snapshots = Snapshots()
    snapshots.sent(1, STATE, 10 * NS_PER_S)
    snapshots.sent(2, None, 10 * NS_PER_S)
    return snapshots


@pytest.mark.parametrize(
    ("number", "now_ns", "seen"),
    [
        (1, 10 * NS_PER_S, STATE),
        (1, 11 * NS_PER_S, STATE),
        (1, 11 * NS_PER_S + 1, None),
        (1, 15 * NS_PER_S, None),
        (2, 10 * NS_PER_S, None),  # no state of safety
        (0, 10 * NS_PER_S, None),
        (3, 10 * NS_PER_S, None),
    ],
)
def test_what_was_seen(snapshots: Snapshots, number: int, now_ns: int, seen: object) -> None:
    assert snapshots.seen(number, now_ns, LIMIT_S) == seen


def test_the_oldest_are_forgotten(snapshots: Snapshots) -> None:
    for number in range(3, 3 + KEPT):
        snapshots.sent(number, STATE, 10 * NS_PER_S)
    assert snapshots.seen(1, 10 * NS_PER_S, LIMIT_S) is None
    assert snapshots.seen(3, 10 * NS_PER_S, LIMIT_S) == STATE
