"""A limit on the silence of a gamepad: the table."""

import pytest

from common.freshness import NS_PER_S
from services.teleop.gamepad_watchdog import GamepadWatchdog


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
def test_silence(watchdog: GamepadWatchdog, quiet_s: float, due: bool, expired: bool) -> None:
    now_ns = 10 * NS_PER_S + round(quiet_s * NS_PER_S)
    watchdog.update(5, now_ns)
    assert watchdog.quiet_s(now_ns) == pytest.approx(quiet_s)
    assert (watchdog.is_due(now_ns), watchdog.is_expired(now_ns)) == (due, expired)


@pytest.mark.parametrize("events", [6, 0, None])
def test_an_event_a_new_gamepad_and_none_begin_anew(
    watchdog: GamepadWatchdog, events: int | None
) -> None:
    watchdog.update(events, 15 * NS_PER_S)
    assert not watchdog.is_due(15 * NS_PER_S)


def test_it_begins_without_a_gamepad() -> None:
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
