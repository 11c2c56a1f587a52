"""Odometry on a fake bus: samples, calls and events."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from common import clock
from common.freshness import NS_PER_S
from services.odom.config import OdomConfig
from services.odom.odometer import Odometer
from t2 import keys
from t2 import messages as m
from t2.words import render
from tests.factories import safety_state
from tests.fake_bus import FakeNode

SPEED = 0.5


class Odometry:
    """Odometry on a fake bus, with the samples of a vehicle that drives straight on."""

    def __init__(self) -> None:
        self.node = FakeNode("odom", OdomConfig())
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

    def set_pose(self, **request: Any) -> str:
        """Set the pose; return what was replied, or the refusal."""
        answers: list[str] = []
        caller: Any = SimpleNamespace(
            refuse=lambda *reasons: answers.append(render(reasons)),
            reply=lambda done: answers.append(done.text),
        )
        self.node.fake.served[keys.SET_POSE.path](m.PoseRequest(**request), caller)
        return answers[0]


@pytest.fixture
def odometry(monkeypatch: pytest.MonkeyPatch) -> Iterator[Odometry]:
    odometry = Odometry()
    monkeypatch.setattr(clock, "now_ns", lambda: odometry.now_ns)
    yield odometry
    odometry.node.loop.close()


def test_an_estimate_follows_each_counter_sample_or_each_check_without(
    odometry: Odometry,
) -> None:
    for _ in range(5):
        odometry.samples()
        odometry.odometer._check(odometry.now_ns)
    count, _ = odometry.node.sent(keys.ODOMETRY)
    assert count == 5
    for _ in range(10):
        odometry.samples(counters=False)
        odometry.odometer._check(odometry.now_ns)
    count, last = odometry.node.sent(keys.ODOMETRY)
    assert count == 5 + 5  # from 0.1 s after the last counters on
    assert last is not None
    assert last.x == pytest.approx(SPEED / 50 * 14, abs=1e-3)


def test_silence_is_reported_once_and_ends(odometry: Odometry) -> None:
    odometry.now_ns += 9 * NS_PER_S
    odometry.odometer._check(odometry.now_ns)
    odometry.samples()
    for _ in range(3):
        odometry.now_ns += round(0.3 * NS_PER_S)
        odometry.odometer._check(odometry.now_ns)
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
    assert "unknown state of safety" in odometry.set_pose(**fresh)
    odometry.node.fake.deliver(keys.SAFETY, safety_state(heartbeat=7))
    assert "no echo" in odometry.set_pose(x=10.0)
    assert "x 10.000 m" in odometry.set_pose(**fresh)


def test_a_pose_that_was_asked_late_is_refused(odometry: Odometry) -> None:
    sent_ns = odometry.now_ns - NS_PER_S - NS_PER_S // 10
    odometry.node.fake.deliver(keys.SAFETY, safety_state(heartbeat=7), sent_ns)
    assert "allowed is 1 s" in odometry.set_pose(x=10.0, echo=7)
    assert "pose_set" not in odometry.node.events
