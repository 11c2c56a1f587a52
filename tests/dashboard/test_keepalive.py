"""The page that keeps the emergency stop alive."""

import pytest

from common.freshness import NS_PER_S
from common.messages import KeepaliveState, SafetyState
from services.dashboard.keepalive import PageKeepalive
from tests.factories import safety_state

TIMEOUT_NS = NS_PER_S


def state(alive: bool, heartbeat: int = 7, name: str = "web") -> SafetyState:
    one = KeepaliveState(source=name, age=0.1 if alive else None, alive=alive, timeout=1.0)
    return safety_state(heartbeat=heartbeat, estop_keepalives=(one,))


def test_the_first_page_holds_it_and_echoes_what_it_showed() -> None:
    page = PageKeepalive("web")
    assert page.answer("ada", state(False, 7), state(False, 9), 5 * NS_PER_S) == 7
    assert page.holder == "ada"
    assert page.answer("ada", state(True, 8), state(True, 9), 5 * NS_PER_S) == 8


@pytest.mark.parametrize(
    ("shown", "newest"),
    [(None, state(False)), (state(False), None), (state(False), state(False, name="pendant"))],
)
def test_an_answer_that_proves_nothing_is_not_sent(
    shown: SafetyState | None, newest: SafetyState | None
) -> None:
    page = PageKeepalive("web")
    assert page.answer("ada", shown, newest, 5 * NS_PER_S) is None
    assert page.holder is None


def test_another_page_takes_over_only_after_safety_has_noticed() -> None:
    page = PageKeepalive("web")
    page.answer("ada", state(False), state(False), 5 * NS_PER_S)
    now_ns = 5 * NS_PER_S + TIMEOUT_NS
    assert page.answer("bob", state(False), state(False), now_ns) is None  # not published yet
    page.left("bob")
    assert page.holder == "ada"
    page.left("ada")
    assert page.answer("bob", state(True), state(True), now_ns + 1) is None  # still counts
    assert page.answer("bob", state(True, 8), state(False), now_ns + 1) == 8
    assert page.holder == "bob"


def test_a_page_that_another_program_precedes_does_not_hold_it() -> None:
    page = PageKeepalive("web")
    assert page.answer("ada", state(True), state(True), 5 * NS_PER_S) is None
    assert page.holder is None
