"""Odometry on the bus: samples, calls and events on a fake bus, then the process on a real one."""

import subprocess
import sys
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from common import clock, keys
from common import messages as m
from common.bus.bus import Bus
from common.config import Loaded
from common.freshness import NS_PER_S
from common.loop import Loop
from common.service import Node
from services.odom.config import OdomConfig
from services.odom.odometer import Odometer
from tests.factories import safety_state
from tests.fake_bus import FakeBus
from verification.harness.bus import bus_on, running
from verification.harness.waiting import PATIENCE_S, wait_until

SPEED, TURNING = 0.5, 0.25
PERIOD_S = 0.02


class FakeNode(Node[OdomConfig]):
    """A node on a ``FakeBus``; its loop does not run."""

    def __init__(self) -> None:
        self.events: list[str] = []
        super().__init__("odom", Loaded(OdomConfig(), {}))

    def open_bus(self) -> FakeBus:
        """Return the fake."""
        self.fake = FakeBus()
        return self.fake

    def event(self, name: str, *args: Any, **about: Any) -> None:
        """Record the event."""
        self.events.append(name)


class Odometry:
    """Odometry on a fake bus, with the samples of a vehicle that drives straight on."""

    def __init__(self) -> None:
        self.node = FakeNode()
        self.odometer = Odometer(self.node)
        self.now_ns = 100 * NS_PER_S
        self.distance = 100.0

    def samples(self, *, counters: bool = True, slip: float = 0.0, **mileage: Any) -> None:
        """Deliver the samples of one period."""
        self.now_ns += NS_PER_S // 50
        self.distance += SPEED / 50
        velocity = m.Velocity(linear=SPEED + slip, angular=0.0)
        self.node.fake.deliver(keys.VELOCITY, velocity, self.now_ns)
        if counters:
            usual: dict[str, Any] = {"distance": self.distance, "heading": 0.0, "epoch": 0}
            self.node.fake.deliver(keys.MILEAGE, m.Mileage(**usual | mileage), self.now_ns)

    @property
    def published(self) -> tuple[int, m.Odometry | None]:
        """The number of messages, and the last one."""
        publisher = next(p for p in self.node.bus.publishers if p.topic is keys.ODOMETRY)
        return publisher._seq, publisher.last

    def set_pose(self, **request: Any) -> str:
        """Set the pose; return what was replied, or the refusal."""
        answers: list[str] = []
        caller: Any = SimpleNamespace(
            refuse=answers.append, reply=lambda done: answers.append(done.text)
        )
        self.odometer._on_set_pose(m.PoseRequest(**request), caller)
        return answers[0]


@pytest.fixture
def odometry(monkeypatch: pytest.MonkeyPatch) -> Iterator[Odometry]:
    odometry = Odometry()
    monkeypatch.setattr(clock, "now_ns", lambda: odometry.now_ns)
    yield odometry
    odometry.node.loop.close()


def test_an_estimate_follows_each_counter_sample_or_each_velocity_without(
    odometry: Odometry,
) -> None:
    for _ in range(5):
        odometry.samples()
    count, _ = odometry.published
    assert count == 6  # the first velocity has no counters yet
    for _ in range(10):
        odometry.samples(counters=False)
    count, last = odometry.published
    assert count == 6 + 5  # from 0.1 s after the last counters on
    assert last is not None
    assert last.x == pytest.approx(SPEED / 50 * 14, abs=1e-3)


def test_silence_is_reported_once_and_ends(odometry: Odometry) -> None:
    odometry.odometer._check_silence(odometry.now_ns + 9 * NS_PER_S)
    odometry.samples()
    for after_s in (0.4, 0.6, 0.9):
        odometry.odometer._check_silence(odometry.now_ns + round(after_s * NS_PER_S))
    odometry.samples()
    assert odometry.node.events == ["velocity_back", "silent", "velocity_back"]


def test_a_restart_and_slip_are_reported(odometry: Odometry) -> None:
    for _ in range(3):
        odometry.samples()
    odometry.samples(epoch=1, distance=0.0)
    assert odometry.node.events == ["velocity_back", "reanchored"]
    odometry.distance = 0.0
    for slip in [3.0] * 10 + [0.0] * 60:
        odometry.samples(slip=slip, epoch=1)
    assert odometry.node.events == ["velocity_back", "reanchored", "slip", "slip_over"]


def test_a_pose_is_set_by_a_recent_call(odometry: Odometry) -> None:
    odometry.samples()
    fresh = {"echo": 7, "x": 10.0, "y": -5.0, "heading": 3.0}
    assert "unknown heartbeat" in odometry.set_pose(**fresh)
    odometry.node.fake.deliver(keys.SAFETY, safety_state(heartbeat=7))
    assert "no echo" in odometry.set_pose(x=10.0)
    assert "x 10.000 m" in odometry.set_pose(**fresh)


def test_a_pose_that_was_asked_late_is_refused(odometry: Odometry) -> None:
    sent_ns = odometry.now_ns - NS_PER_S - NS_PER_S // 10
    odometry.node.fake.deliver(keys.SAFETY, safety_state(heartbeat=7), sent_ns)
    assert "allowed is 1 s" in odometry.set_pose(x=10.0, echo=7)
    assert "pose_set" not in odometry.node.events


# --- the process ----------------------------------------------------------------------------


class World:
    """A bridge that drives an arc, and a reader of what odometry makes of it."""

    def __init__(self) -> None:
        self.received: list[m.Odometry] = []
        self.ticks = 0

    def declare(self, bus: Bus) -> None:
        self.bus = bus
        self.to_velocity = bus.publisher(keys.VELOCITY)
        self.to_mileage = bus.publisher(keys.MILEAGE)
        self.to_safety = bus.publisher(keys.SAFETY)
        bus.subscribe(keys.ODOMETRY, lambda it: self.received.append(it.message), depth=100)

    def tick(self, _: int) -> None:
        self.ticks += 1
        way = self.ticks * PERIOD_S
        self.to_safety.put(safety_state(heartbeat=self.ticks))
        self.to_velocity.put(m.Velocity(linear=SPEED, angular=TURNING))
        self.to_mileage.put(m.Mileage(distance=100 + SPEED * way, heading=TURNING * way, epoch=0))


def test_the_process_follows_the_drive_sets_the_pose_and_ends(shared_router: str) -> None:
    world, loop = World(), Loop()
    answers: list[str] = []
    command = [sys.executable, "-m", "services.odom", "--set", f"bus.connect={shared_router}"]
    with (
        subprocess.Popen(command) as process,
        running(loop),
        bus_on(shared_router, loop, world.declare),
    ):
        try:
            loop.post(lambda: loop.every(PERIOD_S, world.tick))
            wait_until(lambda: world.received and world.received[-1].x > 0.5, "half a metre")
            last = world.received[-1]
            assert last.y > 0  # it turns to the left
            assert (last.linear, last.angular) == (SPEED, TURNING)
            assert (last.frame_id, last.child_frame_id, last.epoch) == ("odom", "base_link", 0)
            pose = m.PoseRequest(x=10.0, y=-5.0, heading=3.0, echo=world.ticks)
            take = answers.append
            world.bus.call(keys.SET_POSE, pose, lambda done: take(done.text), take, PATIENCE_S)
            wait_until(lambda: answers, "an answer")
            assert "x 10.000 m" in answers[0]
            wait_until(lambda: world.received[-1].epoch == 1, "the new pose")
            assert world.received[-1].x > 5
            process.terminate()
            assert process.wait(PATIENCE_S) == 0
        finally:
            process.kill()
