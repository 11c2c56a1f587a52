"""Odometry as a process of its own, behind a real router, beside a bridge that is played here."""

import json
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
import zenoh

from common import keys
from common import messages as m
from common.bus.bus import Arrival, Bus
from common.bus.session import client_config
from common.loop import Loop
from tests.factories import safety_state
from verification.harness.bus import at, bus_on, running
from verification.harness.waiting import PATIENCE_S, wait_until

SPEED, TURNING = 0.5, 0.25
PERIOD_S = 0.02


class World:
    """A bridge that drives an arc, a reader of what odometry makes of it, and a caller."""

    def __init__(self) -> None:
        self.received: list[m.Odometry] = []
        self.events: list[str] = []
        self.speaking = True
        self.velocity: m.Velocity = m.Velocity(linear=SPEED, angular=TURNING)
        self.epoch = 0
        self.heartbeat = 500  # of the safety service that is played here, too
        self.origin = 100.0  # where the counters stand at first
        self.ticks = 0

    def declare(self, bus: Bus) -> None:
        self.bus = bus
        self.to_velocity = bus.publisher(keys.VELOCITY)
        self.to_mileage = bus.publisher(keys.MILEAGE)
        self.to_safety = bus.publisher(keys.SAFETY)
        bus.subscribe(keys.ODOMETRY, self._on_odometry, depth=100)
        bus.subscribe(keys.EVENTS, self._on_event, depth=100, service="odom")

    def _on_odometry(self, arrival: Arrival[m.Odometry]) -> None:
        self.received.append(arrival.message)

    def _on_event(self, arrival: Arrival[m.Event]) -> None:
        self.events.append(arrival.message.name)

    def tick(self, _: int) -> None:
        self.heartbeat += 1
        self.to_safety.put(safety_state(heartbeat=self.heartbeat))
        if not self.speaking:
            return
        self.ticks += 1
        self.to_velocity.put(self.velocity)
        self.to_mileage.put(self.mileage())

    def mileage(self) -> m.Mileage:
        way = self.ticks * PERIOD_S
        return m.Mileage(
            distance=self.origin + SPEED * way, heading=TURNING * way, epoch=self.epoch
        )

    def set_pose(self, request: m.PoseRequest) -> str:
        """Set the pose; return what was replied, or the refusal."""
        answers: list[str] = []
        done = threading.Event()

        def take(text: str) -> None:
            answers.append(text)
            done.set()

        self.bus.call(keys.SET_POSE, request, lambda done: take(done.text), take, PATIENCE_S)
        assert done.wait(PATIENCE_S)
        return answers[0]


@pytest.fixture
def service(endpoint: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run odometry as a process."""
    sets = ["--set", f"bus.connect={endpoint}"]
    with subprocess.Popen([sys.executable, "-m", "services.odom", *sets]) as process:
        try:
            yield process
            process.terminate()
            process.wait(PATIENCE_S)
        finally:
            process.kill()


@pytest.fixture
def world(endpoint: str, service: subprocess.Popen[bytes]) -> Iterator[World]:
    """Play the bridge while the test lasts."""
    world, loop = World(), Loop()
    with running(loop), bus_on(endpoint, loop, world.declare):
        loop.post(lambda: loop.every(PERIOD_S, world.tick))
        wait_until(lambda: world.received, "odometry")
        yield world


def trajectory(endpoint: str) -> Any:
    """Return what ``info/odom/path`` answers."""
    with zenoh.open(client_config(at(endpoint))) as session:
        (reply,) = session.get(keys.info_key("001", "odom", "path"))
        assert reply.ok is not None
        assert str(reply.ok.encoding) == "application/json"
        return json.loads(reply.ok.payload.to_bytes())


def test_the_drive_is_followed(endpoint: str, world: World) -> None:
    wait_until(lambda: len(world.received) > 50 and world.received[-1].x > 0.5, "half a metre")
    last = world.received[-1]
    assert last.y > 0  # it turns to the left
    assert (last.linear, last.angular) == (SPEED, TURNING)
    assert (last.frame_id, last.child_frame_id, last.epoch) == ("odom", "base_link", 0)
    assert world.received[0].x < 0.5  # the counters stand at 100 m
    path = trajectory(endpoint)
    assert path["frame_id"] == "odom"
    assert len(path["points"]) >= 3
    assert path["points"][0][0] < path["points"][-1][0]


def test_a_pose_is_set_and_what_is_no_number_is_refused(endpoint: str, world: World) -> None:
    bad = float("nan")
    wait_until(
        lambda: "NaN" in world.set_pose(m.PoseRequest(x=bad, echo=world.heartbeat)),
        "a received heartbeat",
    )
    pose = m.PoseRequest(x=10.0, y=-5.0, heading=3.0, echo=world.heartbeat)
    assert "x 10.000 m" in world.set_pose(pose)
    wait_until(lambda: world.received[-1].epoch == 1, "the new pose")
    first = next(odometry for odometry in world.received if odometry.epoch == 1)
    assert first.x == pytest.approx(10.0, abs=2.0)
    assert first.y == pytest.approx(-5.0, abs=2.0)
    assert all(point[0] > 5 for point in trajectory(endpoint)["points"])


def test_a_pose_that_was_asked_late_is_refused(world: World) -> None:
    bad = float("nan")
    wait_until(
        lambda: "NaN" in world.set_pose(m.PoseRequest(x=bad, echo=world.heartbeat)),
        "a received heartbeat",
    )
    late = m.PoseRequest(x=10.0, echo=world.heartbeat)
    due_s = time.monotonic() + 1.1
    wait_until(lambda: time.monotonic() > due_s, "a late call")
    assert "allowed is 1 s" in world.set_pose(late)
    assert "no echo" in world.set_pose(m.PoseRequest(x=10.0))
    assert "unknown heartbeat" in world.set_pose(m.PoseRequest(x=10.0, echo=1))
    assert world.received[-1].epoch == 0


def test_silence_is_told_and_nothing_old_is_published_again(world: World) -> None:
    world.speaking = False
    wait_until(lambda: "silent" in world.events, "word of the silence")
    count = len(world.received)
    quiet_until = time.monotonic() + 0.3
    wait_until(lambda: time.monotonic() > quiet_until, "a while")
    assert len(world.received) == count
    world.speaking = True
    wait_until(lambda: world.events.count("heard") >= 2, "word of the return")
    wait_until(lambda: len(world.received) > count, "odometry again")


def test_restart_slip_and_refusal_are_told(world: World) -> None:
    wait_until(lambda: len(world.received) > 25, "odometry that has received the counters, too")
    world.epoch, world.origin = 1, -50.0
    wait_until(lambda: "reanchored" in world.events, "word of the restart")
    assert abs(world.received[-1].x) < 30
    world.velocity = m.Velocity(linear=-SPEED, angular=TURNING)
    wait_until(lambda: "slip" in world.events, "word of the slip")
    wait_until(lambda: any(odometry.slip for odometry in world.received), "odometry that slips")
    world.velocity = m.Velocity(linear=float("nan"), angular=0.0)
    wait_until(lambda: "slip_over" in world.events, "the counters alone")


def test_it_leaves_when_told(service: subprocess.Popen[bytes], world: World) -> None:
    service.send_signal(signal.SIGTERM)
    assert service.wait(PATIENCE_S) == 0
