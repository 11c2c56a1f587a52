"""Localization on a fake bus: odometry, fixes, placements, events."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from common import clock
from services.localization.config import FixSource, Localization, LocalizationConfig
from services.localization.localization import LocalizationService
from t2 import keys
from t2 import messages as m
from t2.words import render
from tests.factories import safety_state
from tests.fake_bus import FakeNode
from tests.localization.core.vehicle_fixture import START, Drive


class Service:
    """Localization on a fake bus, and the vehicle whose odometry it receives."""

    def __init__(self) -> None:
        tags = Localization(sources={"tags": FixSource()})
        self.node = FakeNode("localization", LocalizationConfig(localization=tags))
        self.service = LocalizationService(self.node)
        self.drive = Drive(START)

    def go(self, linear: float = 0.0, steps: int = 1) -> m.MapPose:
        """Drive; return the newest pose."""
        for _ in range(steps):
            self.drive.step(linear, 0.0)
            assert self.drive.odometry is not None
            self.node.fake.deliver(keys.ODOMETRY, self.drive.odometry, self.drive.now_ns)
        return self.published()

    def published(self) -> m.MapPose:
        """Return the newest pose."""
        (publisher,) = (each for each in self.node.bus.publishers if each.topic is keys.MAP_POSE)
        message: Any = publisher.last
        return message  # type: ignore[no-any-return]

    def place(self, echo: int | None, **request: Any) -> str:
        """Place the vehicle; return what was replied, or the refusal."""
        answers: list[str] = []
        caller: Any = SimpleNamespace(
            refuse=lambda *reasons: answers.append(render(reasons)),
            reply=lambda done: answers.append(done.text),
        )
        call = self.node.fake.served[keys.PLACE.path]
        call(m.PlaceRequest(echo=echo, **{"x": 0.0, "y": 0.0, "heading": 0.0} | request), caller)
        return answers[0]

    def state(self, heartbeat: int) -> None:
        """Deliver a state of safety."""
        state = safety_state(heartbeat=heartbeat)
        self.node.fake.deliver(keys.SAFETY, state, self.drive.now_ns)


@pytest.fixture
def service(monkeypatch: pytest.MonkeyPatch) -> Iterator[Service]:
    service = Service()
    monkeypatch.setattr(clock, "now_ns", lambda: service.drive.now_ns)
    yield service
    service.node.loop.close()


def test_a_pose_follows_each_message_of_odometry(service: Service) -> None:
    assert service.go().state == "unplaced"
    service.state(5)
    assert "Done" not in service.place(5)
    pose = service.go(linear=0.5, steps=25)
    assert (pose.state, pose.odom_seq, pose.frame_id) == ("placed", service.drive.seq, "map")
    assert pose.x == pytest.approx(0.5, abs=0.05)
    assert service.node.events == ["unplaced", "placed"]


def test_a_placement_needs_a_young_echo_of_safety(service: Service) -> None:
    service.go()
    service.state(5)
    for echo in (None, 900):
        service.place(echo)
        assert service.published().state == "unplaced"
    service.go(steps=50)
    service.place(5)  # 2 s old
    assert service.published().state == "unplaced"
    service.state(6)
    assert "placed at x 1.00 m, y -2.00 m, 90 degrees" in service.place(
        6, x=1.0, y=-2.0, heading=1.5708
    )
    assert service.published().state == "placed"


def test_a_placement_of_a_moving_vehicle_is_refused(service: Service) -> None:
    service.go(linear=0.3)
    service.state(5)
    assert "The vehicle moves" in service.place(5)


def test_events_name_refused_fixes_once_and_their_return(service: Service) -> None:
    service.go()
    service.state(5)
    service.place(5)

    def fix(**about: Any) -> None:
        service.go(linear=0.3)
        fix = service.drive.measured(**about)
        service.node.fake.deliver(keys.FIX, fix, service.drive.now_ns, source="tags")

    for step in range(8):
        fix(x=10.0 + 7 * (step % 2))
    service.go()
    fix()
    service.go()
    assert service.node.events == ["unplaced", "placed", "fixes_refused", "fixes_back"]


def test_fixes_that_contradict_the_pose_are_an_event(service: Service) -> None:
    service.go()
    service.state(5)
    service.place(5)
    for _ in range(6):
        service.go()
        fix = service.drive.measured(x=9.0)
        service.node.fake.deliver(keys.FIX, fix, service.drive.now_ns, source="tags")
    assert service.go().state == "lost"
    assert service.node.events == ["unplaced", "placed", "lost", "fixes_refused"]
