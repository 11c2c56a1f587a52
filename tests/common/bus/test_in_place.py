"""Samples handled in Zenoh's threads: at once when there is time, by the loop in a flood."""

import threading
import time
from collections.abc import Iterator

import pytest

from common import keys
from common import messages as m
from common.bus.bus import Arrival, Bus
from tests.common.bus_fixture import BusFixture
from verification.harness.bus import at
from verification.harness.waiting import wait_until

HANDLING_S = 0.005  # of one sample
LASTS_S = 2.0
LATE_MAX_S = 0.25  # stamps were seconds late without the rule for floods


@pytest.fixture
def buses(endpoint: str) -> Iterator[BusFixture]:
    with BusFixture(endpoint) as buses:
        yield buses


class Slow:
    """Handles velocities slowly, and notes in which thread, and how late they were stamped."""

    def __init__(self, buses: BusFixture) -> None:
        self.threads: list[int] = []
        self.late_s: list[float] = []
        self.home = 0
        buses.loop.post(self._note_home)
        bus = Bus(at(buses.endpoint), buses.robot, buses.loop.post, buses.loop.submit)
        bus.subscribe(keys.VELOCITY, self._on_velocity)
        self.bus = buses.opened(bus)

    def _note_home(self) -> None:
        self.home = threading.get_ident()

    def _on_velocity(self, arrival: Arrival[m.Velocity]) -> None:
        self.threads.append(threading.get_ident())
        self.late_s.append((arrival.received_ns - arrival.message.mono_ns) / 1e9)
        time.sleep(HANDLING_S)


def test_a_sample_is_handled_in_the_thread_that_brings_it(buses: BusFixture) -> None:
    slow = Slow(buses)
    sender = buses.bus()
    velocity = sender.publisher(keys.VELOCITY)
    wait_until(lambda: velocity.passed_on, "a subscriber")

    def is_in_place() -> bool:
        velocity.put(m.Velocity(linear=0.1, angular=0.0))
        time.sleep(0.02)
        return any(thread != slow.home for thread in slow.threads)

    wait_until(is_in_place, "a sample that was handled in place")


@pytest.mark.timed
def test_in_a_flood_samples_are_stamped_at_once(buses: BusFixture) -> None:
    """A thousand samples a second, of which two hundred can be handled."""
    slow = Slow(buses)  # its loop has no timers: it wakes up for these samples only
    velocity = buses.bus().publisher(keys.VELOCITY)
    wait_until(lambda: velocity.passed_on, "a subscriber")
    end_s = time.monotonic() + LASTS_S
    while time.monotonic() < end_s:
        velocity.put(m.Velocity(linear=0.1, angular=0.0))
        time.sleep(0.001)
    assert len(slow.late_s) > 50
    late_s = sorted(slow.late_s)
    assert late_s[len(late_s) // 2] < LATE_MAX_S
