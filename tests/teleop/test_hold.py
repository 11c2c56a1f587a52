"""Hold to drive: the table, the deadlines and the deadman."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.freshness import S
from services.teleop.hold import ZEROS, Deadman, Keys, Phase, Requests
from services.teleop.mapping import STILL, Twist

GO = Twist(0.2, 0.1)


def at(seconds: float) -> int:
    return round(seconds * S)


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


def test_clear_lets_all_go(keys: Keys) -> None:
    keys.press("w", at(10))
    keys.clear()
    assert keys.held(at(10)) == []


def test_a_deadman_that_is_found_down_does_not_count() -> None:
    deadman = Deadman()
    assert [deadman.held(down) for down in (True, True, False, True)] == [False, False, False, True]


def test_a_dropped_deadman_must_come_up_again() -> None:
    deadman = Deadman()
    deadman.held(False)
    assert deadman.held(True)
    deadman.drop()
    assert not deadman.held(True)
    assert not deadman.held(False)
    assert deadman.held(True)


TABLE = [  # before, held, request, after
    (Requests(Phase.SILENT), None, None, Requests(Phase.SILENT)),
    (Requests(Phase.SILENT), GO, STILL, Requests(Phase.DRIVING)),
    (Requests(Phase.DRIVING), GO, GO, Requests(Phase.DRIVING)),
    (Requests(Phase.DRIVING), None, STILL, Requests(Phase.RELEASING, 2)),
    (Requests(Phase.RELEASING, 2), None, STILL, Requests(Phase.RELEASING, 1)),
    (Requests(Phase.RELEASING, 1), None, STILL, Requests(Phase.SILENT)),
    (Requests(Phase.RELEASING, 2), GO, STILL, Requests(Phase.DRIVING, 2)),
]


@pytest.mark.parametrize(("before", "held", "request_", "after"), TABLE)
def test_the_table(
    before: Requests, held: Twist | None, request_: Twist | None, after: Requests
) -> None:
    requests = replace(before)  # the table's own must not change
    assert requests.tick(held) == request_
    assert requests == after


@pytest.mark.parametrize("phase", Phase)
def test_stop_is_three_zeros_from_any_phase(phase: Phase) -> None:
    requests = Requests(phase, 1)
    requests.stop()
    assert [requests.tick(None) for _ in range(5)] == [STILL] * 3 + [None] * 2


@given(st.lists(st.sampled_from(["go", "idle", "stop"])))
def test_a_drive_begins_with_a_zero_and_ends_with_three(steps: list[str]) -> None:
    requests = Requests()
    sent = []
    for step in [*steps, *["idle"] * (ZEROS + 1)]:
        if step == "stop":
            requests.stop()
        else:
            sent.append(requests.tick(GO if step == "go" else None))
    assert sent[-1] is None
    for i, request in enumerate(sent):
        if request == GO:
            assert sent[i - 1] in (GO, STILL)
            assert i > 0
            assert sent[i + 1] is not None  # a zero or on with it, never silence
