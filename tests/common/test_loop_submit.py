"""The loop: calls that another thread submits, and the lock that lets one thread run at a time."""

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial

import pytest

from common.loop import AT_ONCE_MAX, Loop
from tests.common.bus_fixture import stalled
from verification.harness.bus import running
from verification.harness.waiting import wait_until

THREADS = 8
CALLS = 1000  # of each thread


@pytest.fixture
def loop() -> Iterator[Loop]:
    made = Loop()
    with contextlib.closing(made):
        yield made


def asleep(loop: Loop) -> None:
    """Wait until a running loop sleeps: a submitted call runs in this thread."""
    here = threading.get_ident()
    homes: list[int] = []

    def is_here() -> bool:
        loop.submit(lambda: homes.append(threading.get_ident()))
        return here in homes

    wait_until(is_here, "a loop that sleeps")


def test_a_sleeping_loop_leaves_the_call_to_its_sender() -> None:
    homes: list[int] = []
    with running(Loop()) as loop:
        asleep(loop)
        loop.submit(lambda: homes.append(threading.get_ident()))
        wait_until(lambda: homes, "the call")
    assert homes == [threading.get_ident()]


def test_a_busy_loop_makes_the_call_itself_and_nobody_waits() -> None:
    homes: list[int] = []
    with running(Loop()) as it:
        with stalled(it):
            began_s = time.monotonic()
            it.submit(lambda: homes.append(threading.get_ident()))
            waited_s = time.monotonic() - began_s
            assert homes == []
        wait_until(lambda: homes, "the call")
    assert threading.get_ident() not in homes
    assert waited_s < 5  # as opposed to 20


def test_what_arrives_during_a_submitted_call_is_the_loops() -> None:
    """A sender returns to its samples after the calls that it found."""
    homes: list[int] = []

    def first() -> None:
        it.submit(lambda: homes.append(threading.get_ident()))  # the lock is taken

    with running(Loop()) as it:
        asleep(it)
        it.submit(first)
        wait_until(lambda: homes, "the second call")
    assert threading.get_ident() not in homes


def test_a_sender_makes_few_calls_of_others() -> None:
    """The rest is the loop's, so that the sender returns to its samples soon."""
    homes: list[int] = []

    def submit_many() -> None:
        for _ in range(3 * AT_ONCE_MAX):
            it._submitted.append(lambda: homes.append(threading.get_ident()))

    with running(Loop()) as it:
        with stalled(it):
            submit_many()
        wait_until(lambda: len(homes) == 3 * AT_ONCE_MAX, "all calls")
        asleep(it)
        homes.clear()
        submit_many()
        it.submit(lambda: None)
        wait_until(lambda: len(homes) == 3 * AT_ONCE_MAX, "all calls")
    assert homes.count(threading.get_ident()) == AT_ONCE_MAX


def test_nothing_is_called_before_and_after_the_run(loop: Loop) -> None:
    calls: list[str] = []
    sender = threading.Thread(target=loop.submit, args=(lambda: calls.append("before"),))
    sender.start()
    sender.join()
    assert calls == []
    loop.stop()
    loop.run()  # stopped already: not a single turn
    loop.post(loop.stop)
    loop.run()
    assert calls == ["before"]
    sender = threading.Thread(target=loop.submit, args=(lambda: calls.append("after"),))
    sender.start()
    sender.join()
    assert calls == ["before"]


def test_only_the_thread_that_makes_calls_holds_the_lock(loop: Loop) -> None:
    held: dict[str, bool] = {"construction": loop.held}
    with running(loop):
        asleep(loop)
        held["sender, between its calls"] = loop.held
        loop.submit(lambda: held.update(submitted=loop.held))
        loop.post(lambda: held.update(posted=loop.held))
        wait_until(lambda: len(held) == 4, "both calls")
    assert held == {
        "construction": True,
        "sender, between its calls": False,
        "submitted": True,
        "posted": True,
    }


def test_the_error_of_a_submitted_call_ends_the_run(loop: Loop) -> None:
    errors: list[BaseException] = []
    calls: list[str] = []

    def run() -> None:
        try:
            loop.run()
        except IndexError as error:
            errors.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    asleep(loop)
    loop.submit(lambda: [][0])  # not raised here: in Zenoh's threads nobody would see it
    loop.submit(lambda: calls.append("after the error"))
    thread.join(20)
    assert not thread.is_alive()
    assert len(errors) == 1
    assert calls == []


def test_a_held_loop_calls_nothing_more(loop: Loop) -> None:
    calls: list[str] = []
    thread = threading.Thread(target=loop.run)
    thread.start()
    asleep(loop)
    loop.hold(20.0)
    assert loop.held
    loop.hold(20.0)  # again: at once
    sender = threading.Thread(target=loop.submit, args=(lambda: calls.append("late"),))
    sender.start()
    sender.join()
    assert calls == []
    loop._release()
    loop.stop()
    thread.join(20)


def test_a_hung_handler_delays_the_hold_for_no_longer_than_that() -> None:
    with running(Loop()) as it, stalled(it):
        it.hold(0.01)
        assert not it.held


class OneAtATime:
    """Notes calls that overlap: each takes a moment in which Python may switch threads."""

    def __init__(self) -> None:
        self.inside = 0
        self.overlaps = 0
        self.seen: list[tuple[int, int]] = []
        self.homes: set[int] = set()

    def call(self, sender: int, number: int) -> None:
        before = self.inside
        self.inside = before + 1
        if number % 64 == 0:
            time.sleep(0)  # another thread may run
        self.overlaps += self.inside != before + 1 or before != 0
        self.inside = before
        self.seen.append((sender, number))
        self.homes.add(threading.get_ident())


def test_submits_of_many_threads_run_one_at_a_time_and_none_is_lost() -> None:
    one = OneAtATime()
    with running(Loop()) as loop:
        loop.post(lambda: loop.every(0.001, lambda now_ns: one.call(-1, now_ns)))

        def send(sender: int, way: Callable[[Callable[[], object]], None]) -> None:
            for number in range(CALLS):
                way(partial(one.call, sender, number))
                if number % 7 == 0:
                    time.sleep(0.001)  # the loop falls asleep in between

        threads = [
            threading.Thread(target=send, args=(n, loop.post if n == 0 else loop.submit))
            for n in range(THREADS)
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        total = THREADS * CALLS
        wait_until(lambda: sum(who >= 0 for who, _ in one.seen) == total, "all calls")
    assert one.overlaps == 0
    assert len(one.homes) > 2, "the loop made all calls itself"
    for sender in range(THREADS):
        assert [number for who, number in one.seen if who == sender] == list(range(CALLS))
