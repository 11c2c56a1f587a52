"""Who drives, and what holds count: the table, the round trip, hostile values."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.freshness import NS_PER_S
from services.dashboard.driver_lock import PICTURES, Grip, Push, Wheel

AHEAD = Push(1.0, 0.0)
LIMIT_S = 0.3


def at(seconds: float) -> int:
    return round(seconds * NS_PER_S)


@pytest.fixture
def wheel() -> Wheel:
    """The viewer "a" drives, and picture 1 went out at 10 s."""
    wheel = Wheel(LIMIT_S)
    assert wheel.take("a", force=False)
    wheel.sent(1, at(10))
    return wheel


def test_nobody_drives_at_first() -> None:
    wheel = Wheel(LIMIT_S)
    wheel.sent(1, at(10))
    assert not wheel.hold("a", 1, AHEAD, at(10))
    assert wheel.held(at(10)) is None


def test_the_wheel_is_one_viewers(wheel: Wheel) -> None:
    assert not wheel.take("b", force=False)
    assert wheel.driver == "a"
    assert not wheel.hold("b", 1, AHEAD, at(10))
    assert wheel.take("a", force=False)


def test_taking_over_lets_go_and_starts_in_the_first_gear(wheel: Wheel) -> None:
    wheel.shift("a", 4)
    wheel.hold("a", 1, AHEAD, at(10))
    assert wheel.take("b", force=True)
    assert (wheel.driver, wheel.gear, wheel.held(at(10))) == ("b", 1, None)
    assert not wheel.hold("a", 1, AHEAD, at(10))


def test_taking_it_again_changes_nothing(wheel: Wheel) -> None:
    wheel.shift("a", 4)
    wheel.hold("a", 1, AHEAD, at(10))
    assert wheel.take("a", force=True)
    assert (wheel.gear, wheel.held(at(10))) == (4, AHEAD)


def test_who_leaves_lets_go(wheel: Wheel) -> None:
    wheel.hold("a", 1, AHEAD, at(10))
    wheel.leave("b")
    assert wheel.held(at(10)) == AHEAD
    wheel.leave("a")
    assert (wheel.driver, wheel.held(at(10))) == (None, None)
    assert wheel.take("b", force=False)


def test_only_the_driver_shifts(wheel: Wheel) -> None:
    wheel.shift("b", 5)
    assert wheel.gear == 1


def test_only_the_driver_lets_go(wheel: Wheel) -> None:
    wheel.hold("a", 1, AHEAD, at(10))
    wheel.let_go("b")
    assert wheel.grip is Grip.HELD


def test_a_hold_counts_for_the_round_trip_of_its_picture(wheel: Wheel) -> None:
    assert wheel.hold("a", 1, AHEAD, at(10.3))
    assert wheel.held(at(10.3)) == AHEAD
    assert wheel.held(at(10.3) + 1) is None
    assert wheel.grip is Grip.LAPSED


def test_an_answer_to_an_old_picture_is_refused(wheel: Wheel) -> None:
    assert not wheel.hold("a", 1, AHEAD, at(10.3) + 1)
    assert wheel.grip is Grip.FREE


def test_an_answer_to_no_picture_is_refused(wheel: Wheel) -> None:
    assert not wheel.hold("a", 2, AHEAD, at(10))


def test_a_picture_of_long_ago_is_forgotten(wheel: Wheel) -> None:
    for number in range(2, 2 + PICTURES):
        wheel.sent(number, at(10))
    assert not wheel.hold("a", 1, AHEAD, at(10))
    assert wheel.hold("a", 2, AHEAD, at(10))


def test_every_round_trip_renews(wheel: Wheel) -> None:
    for number in range(2, 40):
        now_ns = at(10) + number * NS_PER_S // 20
        wheel.sent(number, now_ns)
        assert wheel.hold("a", number, AHEAD, now_ns)
        assert wheel.held(now_ns + NS_PER_S // 4) == AHEAD


def test_what_was_overtaken_changes_nothing(wheel: Wheel) -> None:
    wheel.sent(2, at(10.05))
    assert wheel.hold("a", 2, AHEAD, at(10.1))
    assert not wheel.hold("a", 1, Push(-1.0), at(10.1))
    assert wheel.held(at(10.1)) == AHEAD
    assert wheel.answered == 2


def test_after_a_lapse_the_hand_must_come_off(wheel: Wheel) -> None:
    wheel.hold("a", 1, AHEAD, at(10))
    assert wheel.held(at(11)) is None
    wheel.sent(2, at(11))
    assert not wheel.hold("a", 2, AHEAD, at(11))
    wheel.let_go("a")
    assert wheel.hold("a", 2, AHEAD, at(11))


def test_a_free_hand_does_not_lapse(wheel: Wheel) -> None:
    wheel.lapse()
    assert wheel.grip is Grip.FREE


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_no_number_is_refused(wheel: Wheel, wrong: float) -> None:
    assert not wheel.hold("a", 1, Push(wrong, 0.0), at(10))
    assert not wheel.hold("a", 1, Push(0.0, wrong), at(10))
    assert wheel.held(at(10)) is None


def test_more_than_full_is_full(wheel: Wheel) -> None:
    wheel.hold("a", 1, Push(7.0, -7.0, release="backward"), at(10))
    assert wheel.held(at(10)) == Push(1.0, -1.0, release="backward")


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
    """A wheel, and when each viewer's hold last counted."""

    def __init__(self) -> None:
        self.wheel = Wheel(LIMIT_S)
        self.now_ns = 0
        self.counted_ns: dict[str, int] = {}

    def step(self, what: str, who: str, number: int, seconds: float) -> None:
        match what:
            case "take" | "force":
                self.wheel.take(who, force=what == "force")
            case "leave":
                self.wheel.leave(who)
            case "free":
                self.wheel.let_go(who)
            case "sent":
                self.wheel.sent(number, self.now_ns)
            case "hold" if self.wheel.hold(who, number, AHEAD, self.now_ns):
                self.counted_ns[who] = self.now_ns
            case "wait":
                self.now_ns += round(seconds * NS_PER_S)


@given(STEPS)
def test_what_is_held_was_held_by_the_driver_within_the_round_trip(
    steps: list[tuple[str, str, int, float]],
) -> None:
    play = Play()
    for step in steps:
        play.step(*step)
        if play.wheel.held(play.now_ns) is not None:
            assert play.wheel.driver is not None
            assert play.now_ns - play.counted_ns[play.wheel.driver] <= LIMIT_S * NS_PER_S
