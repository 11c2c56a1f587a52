"""Hold to drive: deadlines of keys, the deadman, and the gamepad watchdog's table."""

import pytest

from common.freshness import NS_PER_S
from services.teleop.core.hold import Deadman, GamepadWatchdog, Keys, Press


def at(seconds: float) -> int:
    return round(seconds * NS_PER_S)


@pytest.fixture
def keys() -> Keys:
    return Keys(first_s=0.6, repeat_s=0.3)


def test_a_tap_holds_for_the_first_time(keys: Keys) -> None:
    keys.press("w", at(10))
    assert keys.held(at(10.599)) == ["w"]
    assert keys.held(at(10.6)) == []


def test_a_repeat_holds_for_less(keys: Keys) -> None:
    keys.press("w", at(10))
    keys.press("w", at(10.5))
    assert keys.held(at(10.799)) == ["w"]
    assert keys.held(at(10.8)) == []


def test_a_press_after_the_hold_is_a_first_one_again(keys: Keys) -> None:
    keys.press("w", at(10))
    keys.press("w", at(10.6))
    assert keys.held(at(11.199)) == ["w"]


def test_each_key_has_its_own_deadline(keys: Keys) -> None:
    keys.press("w", at(10))
    keys.press("a", at(10.5))
    assert keys.held(at(10.55)) == ["w", "a"]
    assert keys.held(at(10.7)) == ["a"]


def test_a_key_pressed_alone_releases_the_others_and_repeats(keys: Keys) -> None:
    keys.press("f", at(10))
    keys.press_alone("b", at(10.1))
    assert keys.held(at(10.15)) == ["b"]
    keys.press_alone("b", at(10.5))
    assert keys.held(at(10.799)) == ["b"]
    assert keys.held(at(10.8)) == []


def test_clear_releases_all_keys(keys: Keys) -> None:
    keys.press("w", at(10))
    keys.clear()
    assert keys.held(at(10)) == []


def test_muted_keys_count_again_after_a_pause(keys: Keys) -> None:
    keys.press("w", at(10))
    keys.mute(at(10.1))
    assert keys.held(at(10.1)) == []
    for still_held in (10.699, 11.298):
        keys.press("w", at(still_held))
        assert keys.held(at(still_held)) == []
    keys.press("w", at(11.898))
    assert keys.held(at(11.898)) == ["w"]


def test_the_age_of_a_press() -> None:
    assert Press("w", at(10)).age_s(at(12.5)) == 2.5


def test_a_deadman_that_is_found_down_does_not_count() -> None:
    deadman = Deadman()
    assert [deadman.held(down) for down in (True, True, False, True)] == [False, False, False, True]


def test_a_dropped_deadman_must_come_up_again() -> None:
    deadman = Deadman()
    deadman.held(False)
    assert deadman.held(True)
    deadman.drop()
    assert deadman.seen_up is False
    assert not deadman.held(True)
    assert not deadman.held(False)
    assert deadman.held(True)


@pytest.fixture
def watchdog() -> GamepadWatchdog:
    watchdog = GamepadWatchdog(2.0)
    watchdog.update(5, 10 * NS_PER_S)
    return watchdog


@pytest.mark.parametrize(
    ("quiet_s", "due", "expired"),
    [(0.0, False, False), (1.0, False, False), (1.05, True, False), (2.0, True, False),
     (2.05, True, True), (60.0, True, True)],
)  # fmt: skip
def test_the_limits_of_the_gamepad_watchdog(
    watchdog: GamepadWatchdog, quiet_s: float, due: bool, expired: bool
) -> None:
    now_ns = 10 * NS_PER_S + round(quiet_s * NS_PER_S)
    watchdog.update(5, now_ns)
    assert watchdog.quiet_s(now_ns) == pytest.approx(quiet_s)
    assert (watchdog.is_due(now_ns), watchdog.is_expired(now_ns)) == (due, expired)


@pytest.mark.parametrize("events", [6, 0, None])
def test_an_event_and_a_new_or_lost_gamepad_restart_the_time(
    watchdog: GamepadWatchdog, events: int | None
) -> None:
    watchdog.update(events, 15 * NS_PER_S)
    assert not watchdog.is_due(15 * NS_PER_S)


def test_the_watchdog_starts_without_a_gamepad() -> None:
    watchdog = GamepadWatchdog(2.0)
    assert watchdog.quiet_s(10 * NS_PER_S) == 10.0
    watchdog.update(0, 10 * NS_PER_S)
    assert watchdog.quiet_s(10 * NS_PER_S) == 0.0


def test_no_gamepad_is_never_silent(watchdog: GamepadWatchdog) -> None:
    watchdog.update(None, 12 * NS_PER_S)
    watchdog.update(None, 20 * NS_PER_S)
    assert watchdog.quiet_s(20 * NS_PER_S) == 0.0
    watchdog.update(5, 21 * NS_PER_S)  # it is back
    assert watchdog.quiet_s(22 * NS_PER_S) == 1.0
