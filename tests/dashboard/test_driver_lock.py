"""The driver lock: its table, the round trip, hostile values."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.freshness import NS_PER_S
from services.dashboard.driver_lock import SNAPSHOTS_KEPT, DriverLock, HoldState, Push

AHEAD = Push(1.0, 0.0)
LIMIT_S = 0.3


def at(seconds: float) -> int:
    return round(seconds * NS_PER_S)


@pytest.fixture
def lock() -> DriverLock:
    """The viewer "a" drives, and snapshot 1 was sent at 10 s."""
    lock = DriverLock(LIMIT_S)
    assert lock.take("a", force=False)
    lock.sent(1, at(10))
    return lock


def test_there_is_no_driver_at_first() -> None:
    lock = DriverLock(LIMIT_S)
    lock.sent(1, at(10))
    assert not lock.hold("a", 1, AHEAD, at(10))
    assert lock.held(at(10)) is None


def test_one_viewer_has_the_lock(lock: DriverLock) -> None:
    assert not lock.take("b", force=False)
    assert lock.driver == "a"
    assert not lock.hold("b", 1, AHEAD, at(10))
    assert lock.take("a", force=False)


def test_a_takeover_ends_the_hold_and_starts_in_gear_1(lock: DriverLock) -> None:
    lock.shift("a", 4)
    lock.hold("a", 1, AHEAD, at(10))
    assert lock.take("b", force=True)
    assert (lock.driver, lock.gear, lock.held(at(10))) == ("b", 1, None)
    assert not lock.hold("a", 1, AHEAD, at(10))


def test_taking_the_lock_again_changes_nothing(lock: DriverLock) -> None:
    lock.shift("a", 4)
    lock.hold("a", 1, AHEAD, at(10))
    assert lock.take("a", force=True)
    assert (lock.gear, lock.held(at(10))) == (4, AHEAD)


def test_leaving_ends_the_hold(lock: DriverLock) -> None:
    lock.hold("a", 1, AHEAD, at(10))
    lock.leave("b")
    assert lock.held(at(10)) == AHEAD
    lock.leave("a")
    assert (lock.driver, lock.held(at(10))) == (None, None)
    assert lock.take("b", force=False)


def test_only_the_driver_shifts(lock: DriverLock) -> None:
    lock.shift("b", 5)
    assert lock.gear == 1


def test_only_the_driver_ends_the_hold(lock: DriverLock) -> None:
    lock.hold("a", 1, AHEAD, at(10))
    lock.let_go("b")
    assert lock.state is HoldState.HELD


def test_a_hold_is_valid_for_the_round_trip_of_its_snapshot(lock: DriverLock) -> None:
    assert lock.hold("a", 1, AHEAD, at(10.3))
    assert lock.held(at(10.3)) == AHEAD
    assert lock.held(at(10.3) + 1) is None
    assert lock.state is HoldState.LAPSED


def test_an_answer_to_an_old_snapshot_is_refused(lock: DriverLock) -> None:
    assert not lock.hold("a", 1, AHEAD, at(10.3) + 1)
    assert lock.state is HoldState.FREE


def test_an_answer_to_an_unknown_snapshot_is_refused(lock: DriverLock) -> None:
    assert not lock.hold("a", 2, AHEAD, at(10))


def test_only_the_newest_snapshots_are_kept(lock: DriverLock) -> None:
    for number in range(2, 2 + SNAPSHOTS_KEPT):
        lock.sent(number, at(10))
    assert not lock.hold("a", 1, AHEAD, at(10))
    assert lock.hold("a", 2, AHEAD, at(10))


def test_every_answer_renews_the_hold(lock: DriverLock) -> None:
    for number in range(2, 40):
        now_ns = at(10) + number * NS_PER_S // 20
        lock.sent(number, now_ns)
        assert lock.hold("a", number, AHEAD, now_ns)
        assert lock.held(now_ns + NS_PER_S // 4) == AHEAD


def test_a_reordered_hold_changes_nothing(lock: DriverLock) -> None:
    lock.sent(2, at(10.05))
    assert lock.hold("a", 2, AHEAD, at(10.1))
    assert not lock.hold("a", 1, Push(-1.0), at(10.1))
    assert lock.held(at(10.1)) == AHEAD
    assert lock.answered == 2


def test_after_a_lapse_a_release_is_required(lock: DriverLock) -> None:
    lock.hold("a", 1, AHEAD, at(10))
    assert lock.held(at(11)) is None
    lock.sent(2, at(11))
    assert not lock.hold("a", 2, AHEAD, at(11))
    lock.let_go("a")
    assert lock.hold("a", 2, AHEAD, at(11))


def test_a_free_lock_does_not_lapse(lock: DriverLock) -> None:
    lock.lapse()
    assert lock.state is HoldState.FREE


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_a_non_finite_push_is_refused(lock: DriverLock, wrong: float) -> None:
    assert not lock.hold("a", 1, Push(wrong, 0.0), at(10))
    assert not lock.hold("a", 1, Push(0.0, wrong), at(10))
    assert lock.held(at(10)) is None


def test_a_push_is_clamped(lock: DriverLock) -> None:
    lock.hold("a", 1, Push(7.0, -7.0, release="backward"), at(10))
    assert lock.held(at(10)) == Push(1.0, -1.0, release="backward")


STEPS = st.lists(
    st.tuples(
        st.sampled_from(["take", "force", "leave", "hold", "free", "sent", "wait"]),
        st.sampled_from(["a", "b"]),
        st.integers(0, 12),
        st.floats(0.0, 0.5),
    ),
    max_size=60,
)


class Play:
    """A lock, and the time of each viewer's last valid hold."""

    def __init__(self) -> None:
        self.lock = DriverLock(LIMIT_S)
        self.now_ns = 0
        self.counted_ns: dict[str, int] = {}

    def step(self, what: str, who: str, number: int, seconds: float) -> None:
        match what:
            case "take" | "force":
                self.lock.take(who, force=what == "force")
            case "leave":
                self.lock.leave(who)
            case "free":
                self.lock.let_go(who)
            case "sent":
                self.lock.sent(number, self.now_ns)
            case "hold" if self.lock.hold(who, number, AHEAD, self.now_ns):
                self.counted_ns[who] = self.now_ns
            case "wait":
                self.now_ns += round(seconds * NS_PER_S)


@given(STEPS)
def test_a_valid_hold_is_the_drivers_and_within_the_round_trip(
    steps: list[tuple[str, str, int, float]],
) -> None:
    play = Play()
    for step in steps:
        play.step(*step)
        if play.lock.held(play.now_ns) is not None:
            assert play.lock.driver is not None
            assert play.now_ns - play.counted_ns[play.lock.driver] <= LIMIT_S * NS_PER_S
