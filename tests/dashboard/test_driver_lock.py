"""The driver lock, and the page that keeps the emergency stop alive."""

import pytest

from common.freshness import NS_PER_S, Latest
from services.dashboard.driver_lock import (
    HOLD_S,
    DriverLock,
    HoldState,
    PageKeepalive,
    Push,
    Shown,
)
from t2.messages import SafetyState, Silence
from tests.factories import limit_source, safety_state

AHEAD = Push(1.0, 0.0)
HOLD_NS = round(HOLD_S * NS_PER_S)
NOW_NS = 10 * NS_PER_S
FREE, HELD, LAPSED = HoldState


def shown(received_ns: int = NOW_NS, heartbeat: int = 7) -> Shown:
    return Latest(safety_state(heartbeat=heartbeat), received_ns)


@pytest.fixture
def lock() -> DriverLock:
    """The viewer "a" drives."""
    lock = DriverLock()
    assert lock.take("a", force=False)
    return lock


def in_state(lock: DriverLock, state: HoldState) -> None:
    if state is not FREE:
        lock.hold(AHEAD, shown(), NOW_NS)
    if state is LAPSED:
        lock.lapse()
    assert lock.state is state


@pytest.mark.parametrize(
    ("state", "answered", "after", "push"),
    [
        (FREE, shown(NOW_NS - HOLD_NS), HELD, Push(0.5)),
        (FREE, shown(NOW_NS - HOLD_NS - 1), FREE, Push()),
        (FREE, None, FREE, Push()),
        (HELD, shown(NOW_NS - HOLD_NS), HELD, Push(0.5)),
        (HELD, shown(NOW_NS - HOLD_NS - 1), HELD, AHEAD),
        (HELD, None, HELD, AHEAD),
        (LAPSED, shown(), LAPSED, Push()),
    ],
)
def test_a_hold_in_each_state(
    lock: DriverLock, state: HoldState, answered: Shown, after: HoldState, push: Push
) -> None:
    in_state(lock, state)
    lock.hold(Push(0.5), answered, NOW_NS)
    assert (lock.state, lock.push) == (after, push)


@pytest.mark.parametrize("state", HoldState)
def test_letting_go(lock: DriverLock, state: HoldState) -> None:
    in_state(lock, state)
    lock.let_go()
    assert (lock.state, lock.push) == (FREE, Push())


@pytest.mark.parametrize(("state", "after"), [(FREE, FREE), (HELD, LAPSED), (LAPSED, LAPSED)])
def test_a_lapse(lock: DriverLock, state: HoldState, after: HoldState) -> None:
    in_state(lock, state)
    lock.lapse()
    assert (lock.state, lock.push) == (after, Push())


def test_a_hold_lapses_with_the_age_of_what_it_answers(lock: DriverLock) -> None:
    assert lock.held(NOW_NS) is None
    lock.hold(AHEAD, shown(), NOW_NS + HOLD_NS // 2)
    assert lock.held(NOW_NS + HOLD_NS) == AHEAD
    assert lock.shown == shown()  # its heartbeat is the echo of the requests
    assert lock.held(NOW_NS + HOLD_NS + 1) is None
    assert lock.state is LAPSED


def test_one_viewer_has_the_lock(lock: DriverLock) -> None:
    in_state(lock, HELD)
    assert not lock.take("b", force=False)
    lock.leave("b")
    assert (lock.driver, lock.state, lock.gear) == ("a", HELD, 1)


def test_a_takeover_ends_the_hold_and_starts_in_gear_1(lock: DriverLock) -> None:
    lock.gear = 4
    in_state(lock, HELD)
    assert lock.take("a", force=True)  # by the driver: no change
    assert (lock.gear, lock.state) == (4, HELD)
    assert lock.take("b", force=True)
    assert (lock.driver, lock.gear, lock.state) == ("b", 1, FREE)
    lock.leave("b")
    assert (lock.driver, lock.state) == (None, FREE)


def test_a_push_is_clamped(lock: DriverLock) -> None:
    lock.hold(Push(7.0, -7.0, release="backward"), shown(), NOW_NS)
    assert lock.held(NOW_NS) == Push(1.0, -1.0, release="backward")


TIMEOUT_NS = NS_PER_S


def kept(
    alive: bool, heartbeat: int = 7, name: str = "web", silence: Silence = "latch"
) -> SafetyState:
    one = limit_source(name, age=0.1 if alive else None, silent=not alive, silence=silence)
    return safety_state(heartbeat=heartbeat, limit_sources=(one,))


def test_the_first_page_keeps_the_stop_alive_and_echoes_what_it_showed() -> None:
    page = PageKeepalive("web")
    assert page.answer("ada", shown(heartbeat=7), kept(False, 9), NOW_NS) == 7
    assert page.holder == "ada"
    assert page.answer("ada", shown(heartbeat=8), kept(True, 9), NOW_NS) == 8


@pytest.mark.parametrize(
    ("answered", "newest"),
    [
        (None, kept(False)),
        (shown(), None),
        (shown(), kept(False, name="pendant")),
        (shown(), kept(True)),  # another program keeps it alive
        (shown(), kept(False, silence="stop")),  # a limit, and no emergency stop
    ],
)
def test_an_answer_that_proves_nothing_is_not_sent(
    answered: Shown, newest: SafetyState | None
) -> None:
    page = PageKeepalive("web")
    assert page.answer("ada", answered, newest, NOW_NS) is None
    assert page.holder is None


def test_another_page_takes_over_only_after_safety_has_noticed() -> None:
    page = PageKeepalive("web")
    page.answer("ada", shown(), kept(False), NOW_NS + NS_PER_S // 2)
    now_ns = NOW_NS + TIMEOUT_NS
    assert page.answer("bob", shown(now_ns), kept(False), now_ns) is None  # not published yet
    page.left("bob")
    assert page.holder == "ada"
    page.left("ada")
    assert page.answer("bob", shown(now_ns), kept(True), now_ns + 1) is None  # still counts
    assert page.answer("bob", shown(now_ns, 8), kept(False), now_ns + 1) == 8
    assert page.holder == "bob"
