"""The loop: its timers, its sockets, what other threads post, and its end."""

import contextlib
import socket
import threading
from collections.abc import Iterator
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


def test_a_timer_is_due_at_once_and_then_every_period(loop: Loop, clock: Clock) -> None:
    calls: list[int] = []
    loop.every(1.0, calls.append)
    turn(loop)
    assert calls == [100 * NS_PER_S]
    clock.pass_s(0.99)
    turn(loop)
    assert len(calls) == 1
    clock.pass_s(0.01)
    turn(loop)
    assert calls == [100 * NS_PER_S, 101 * NS_PER_S]


def test_a_late_timer_is_called_once_and_keeps_its_beat(loop: Loop, clock: Clock) -> None:
    calls: list[int] = []
    loop.every(1.0, calls.append)
    turn(loop)
    clock.pass_s(5.4)
    turn(loop)
    turn(loop)
    assert calls == [
        100 * NS_PER_S,
        round(105.4 * NS_PER_S),
    ]  # no burst for the four that were missed
    clock.pass_s(0.6)
    turn(loop)
    assert calls[2:] == [106 * NS_PER_S]


def test_a_timer_that_is_put_off_is_due_a_period_later(loop: Loop, clock: Clock) -> None:
    calls: list[int] = []
    timer = loop.every(1.0, calls.append)
    turn(loop)
    for _ in range(3):
        clock.pass_s(0.9)
        timer.defer(clock.now_ns())
        turn(loop)
    assert calls == [100 * NS_PER_S]
    clock.pass_s(1.0)
    turn(loop)
    assert calls[1:] == [round(103.7 * NS_PER_S)]


def test_who_is_put_off_too_late_was_late(loop: Loop, clock: Clock) -> None:
    timer = loop.every(1.0, lambda _: None)
    turn(loop)
    clock.pass_s(1.5)
    loop.post(lambda: timer.defer(clock.now_ns()))
    turn(loop)
    assert loop.take_lateness_s() == 0.5


def test_lateness_is_the_worst_since_it_was_asked_for(loop: Loop, clock: Clock) -> None:
    loop.every(1.0, lambda _: None)
    loop.every(0.5, lambda _: None)
    turn(loop)
    clock.pass_s(1.25)
    turn(loop)
    assert loop.take_lateness_s() == 0.75  # of the timer that was due at 0.5
    assert loop.take_lateness_s() == 0.0


def test_a_timer_may_set_a_timer(loop: Loop, clock: Clock) -> None:
    calls: list[str] = []
    loop.every(9.0, lambda _: loop.every(9.0, lambda _: calls.append("inner")))
    turn(loop)
    turn(loop)
    assert calls == ["inner"]


def test_what_was_posted_is_done_before_timers_judge_its_age(loop: Loop, clock: Clock) -> None:
    order: list[str] = []
    loop.every(1.0, lambda _: order.append("timer"))
    loop.post(lambda: order.append("posted"))
    turn(loop)
    assert order == ["posted", "timer"]


def test_an_idle_loop_sleeps_until_the_next_timer(loop: Loop, clock: Clock) -> None:
    assert loop._until_due_s() is None
    loop.every(2.0, lambda _: None)
    assert loop._until_due_s() == 0
    turn(loop)
    clock.pass_s(0.5)
    assert loop._until_due_s() == 1.5
    clock.pass_s(9.0)
    assert loop._until_due_s() == 0


# --- its end ------------------------------------------------------------------------------------


def test_a_stop_before_run_is_kept(loop: Loop) -> None:
    loop.stop()
    loop.run()  # returns, or the test times out


def test_it_runs_again_after_a_stop(loop: Loop) -> None:
    turn(loop)
    calls: list[int] = []
    loop.post(lambda: calls.append(1))
    turn(loop)
    assert calls == [1]


def test_a_stop_from_another_thread_ends_an_idle_loop(loop: Loop) -> None:
    thread = threading.Thread(target=loop.run)
    thread.start()
    loop.stop()
    thread.join(20)
    assert not thread.is_alive()


def test_posting_after_the_end_is_harmless() -> None:
    loop = Loop()
    loop.close()
    loop.post(lambda: None)
    loop.stop()


def test_an_error_of_ours_is_not_swallowed(loop: Loop) -> None:
    loop.post(lambda: [][0])
    with pytest.raises(IndexError):
        loop.run()


# --- other threads, sockets ---------------------------------------------------------------------


def test_posts_of_many_threads_arrive_all_and_in_order_in_one_thread() -> None:
    seen: list[tuple[int, int]] = []
    homes: set[int] = set()

    def hear(sender: int, number: int) -> None:
        seen.append((sender, number))
        homes.add(threading.get_ident())

    def send(sender: int) -> None:
        for number in range(2000):  # more than the wake-up pipe holds
            busy.post(partial(hear, sender, number))

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


def test_a_call_that_posts_again_does_not_starve_timers(loop: Loop, clock: Clock) -> None:
    calls = 0

    def again() -> None:
        loop.post(again)

    def tick(_: int) -> None:
        nonlocal calls
        calls += 1
        loop.stop()

    loop.every(1.0, tick)
    again()
    loop.run()
    assert calls == 1


def test_a_socket_is_read_when_there_is_something(loop: Loop) -> None:
    ours, theirs = socket.socketpair()
    got: list[bytes] = []
    with ours, theirs:
        loop.watch(ours, lambda _: got.append(ours.recv(100)))
        turn(loop)
        assert got == []
        theirs.send(b"frame")
        loop.every(0.01, lambda _: loop.stop() if got else None)
        loop.run()
    assert got == [b"frame"]
