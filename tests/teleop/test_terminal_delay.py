"""Delay of the terminal at the controller: late key presses and slow answers release the keys."""

import pytest

from common.freshness import NS_PER_S
from tests.teleop.support import Operator


@pytest.mark.parametrize("key", ["w", "r", "f", "b", "t", "5"])
def test_a_press_that_waited_for_long_does_nothing(operator: Operator, key: str) -> None:
    operator.tell_contact()
    for _ in range(5):
        operator.press(key, waited_s=0.51)
    assert operator.speeds(3) == [None] * 3
    assert operator.node.fake.asked == []
    assert (operator.controller.view.gear, operator.controller.view.turbo) == (1, False)
    assert operator.lines == [f"key {key.upper()} ignored: it is 0.5 s old"]
    operator.wait(1.5)
    operator.press(key, waited_s=3.0)
    assert operator.lines[1:] == [f"key {key.upper()} ignored: it is 3.0 s old"]


def test_an_estop_and_a_stop_count_at_any_age(operator: Operator) -> None:
    operator.press("e", waited_s=60.0)
    assert operator.node.fake.estops == 1
    operator.ticks(5)
    operator.press("space", waited_s=60.0)
    assert operator.speeds(4) == [0.0] * 3 + [None]


def test_a_recent_press_counts_from_its_receive_time(operator: Operator) -> None:
    operator.ticks(10)
    operator.press("w", waited_s=0.3)
    assert [speed for speed in operator.speeds(10) if speed] == [0.2] * 5


def slow(operator: Operator, took_s: float = 0.42) -> None:
    """Simulate a terminal that answers late from now on."""
    operator.near = False
    operator.controller.terminal.sent(1, operator.now_ns - round(took_s * NS_PER_S))
    operator.controller.terminal.answered(1, operator.now_ns)


@pytest.mark.parametrize("key", ["w", "left", "f", "b", "r"])
def test_on_a_slow_terminal_keys_move_and_reset_nothing(operator: Operator, key: str) -> None:
    operator.tell_contact()
    slow(operator)
    for _ in range(3):
        operator.press(key)
        assert operator.speeds(1) == [None]
    assert operator.node.fake.asked == []
    assert operator.lines == [
        "keys ignored: terminal too slow: 0.42 s, allowed 0.15 s; "
        "use `t2 drive` on a machine near the robot, or the dashboard"
    ]
    assert operator.controller.view.keys_refused == "terminal too slow: 0.42 s, allowed 0.15 s"


def test_on_a_slow_terminal_a_stop_counts(operator: Operator) -> None:
    slow(operator)
    operator.press("e")
    assert operator.node.fake.estops == 1
    assert operator.speeds(4) == [0.0] * 3 + [None]
    operator.press("space")
    assert operator.speeds(4) == [0.0] * 3 + [None]


def test_a_terminal_that_becomes_slow_releases_its_keys(operator: Operator) -> None:
    operator.press("w")
    assert operator.speeds(2) == [0.0, 0.2]
    slow(operator)
    assert operator.speeds(5) == [0.0] * 3 + [None] * 2
    operator.near = True
    for _ in range(40):  # what is still held when it is fast again does not drive
        operator.press("w")
        assert operator.speeds(1) == [None]
    operator.ticks(20)
    operator.press("w")
    assert operator.speeds(2) == [0.0, 0.2]
    assert len([line for line in operator.lines if "keys ignored" in line]) == 1


def test_a_terminal_that_stops_answering_releases_its_keys(operator: Operator) -> None:
    operator.near = False
    speeds = []
    for _ in range(20):
        operator.press("w")
        speeds += operator.speeds(1)
    assert speeds[1] == 0.2
    assert speeds[-5:] == [None] * 5
