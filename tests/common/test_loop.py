"""The loop: its timers, its sockets, what other threads post, and its end."""

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial

import pytest

from common import loop as loop_module
from common.freshness import NS_PER_S
from common.loop import Loop
from verification.harness.bus import running
from verification.harness.waiting import wait_until


class Clock:
    """A clock that the test advances."""

    def __init__(self) -> None:
        self.at_ns = 100 * NS_PER_S

    def now_ns(self) -> int:
        return self.at_ns

    def pass_s(self, seconds: float) -> None:
        self.at_ns += round(seconds * NS_PER_S)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(loop_module, "clock", made)
    return made


@pytest.fixture
def loop() -> Iterator[Loop]:
    made = Loop()
    with contextlib.closing(made):
        yield made


def turn(loop: Loop) -> None:
    """Run what is due in the loop once."""
    loop.post(loop.stop)
    loop.run()


# --- timers, on a clock of the test's own -------------------------------------------------------


@pytest.mark.parametrize(
    ("after_s", "calls_s"),
    [
        ([], [0.0]),  # due at once
        ([0.99], [0.0]),
        ([0.99, 0.01], [0.0, 1.0]),
        ([5.4, 0.0, 0.6], [0.0, 5.4, 6.0]),  # late: once, without a burst, and on its beat again
    ],
)
def test_a_timer_is_due_every_period(
    loop: Loop, clock: Clock, after_s: list[float], calls_s: list[float]
) -> None:
    calls: list[int] = []
    loop.every(1.0, calls.append)
    turn(loop)
    for seconds in after_s:
        clock.pass_s(seconds)
        turn(loop)
    assert calls == [round((100 + at_s) * NS_PER_S) for at_s in calls_s]


def test_lateness_is_the_worst_since_the_last_report(loop: Loop, clock: Clock) -> None:
    loop.every(1.0, lambda _: None)
    loop.every(0.5, lambda _: None)
    turn(loop)
    clock.pass_s(1.25)
    turn(loop)
    assert loop.take_lateness_s() == 0.75  # of the timer that was due at 0.5
    assert loop.take_lateness_s() == 0.0


@pytest.mark.parametrize("queue", [Loop.post, Loop.defer])
def test_queued_calls_are_made_before_timers_judge_their_age(
    loop: Loop, clock: Clock, queue: Callable[[Loop, Callable[[], None]], None]
) -> None:
    order: list[str] = []
    loop.every(1.0, lambda _: order.append("timer"))
    queue(loop, lambda: order.append("queued"))
    turn(loop)
    assert order == ["queued", "timer"]


def test_a_call_that_posts_again_does_not_starve_timers(loop: Loop) -> None:
    def again() -> None:
        loop.post(again)

    loop.every(1.0, lambda _: loop.stop())
    again()
    loop.run()  # returns, or the test times out


# --- its end ------------------------------------------------------------------------------------


def test_a_stop_before_run_is_kept_and_it_runs_again_after_that(loop: Loop) -> None:
    loop.stop()
    loop.run()
    calls: list[int] = []
    loop.post(lambda: calls.append(1))
    turn(loop)
    assert calls == [1]


# --- other threads, sockets ---------------------------------------------------------------------


def test_a_deferred_call_waits_until_something_wakes_the_loop() -> None:
    called: list[str] = []
    with running(Loop()) as idle:
        wait_until(lambda: idle._sleeps, "its sleep")
        idle.defer(lambda: called.append("deferred"))
        assert idle._sleeps
        idle.post(lambda: called.append("posted"))
        wait_until(lambda: len(called) == 2, "both calls")
    assert called == ["deferred", "posted"]


def test_posts_of_many_threads_arrive_all_and_in_order_in_one_thread() -> None:
    seen: list[tuple[int, int]] = []
    homes: set[int] = set()

    def take(sender: int, number: int) -> None:
        seen.append((sender, number))
        homes.add(threading.get_ident())

    def send(sender: int) -> None:
        for number in range(2000):
            busy.post(partial(take, sender, number))
            if number % 7 == 0:
                time.sleep(0)  # the loop may fall asleep in between

    with running(Loop()) as busy:
        senders = [threading.Thread(target=send, args=(sender,)) for sender in range(3)]
        for thread in senders:
            thread.start()
        wait_until(lambda: len(seen) == 6000, "all that was posted")
        for thread in senders:
            thread.join()
    assert len(homes) == 1
    for sender in range(3):
        assert [number for who, number in seen if who == sender] == list(range(2000))
