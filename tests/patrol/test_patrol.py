"""The service on a fake bus: calls, state, events, lamp, schedule, and the folder."""

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from common import clock
from services.patrol import patrol as shell
from services.patrol.config import Patrol, PatrolConfig, ScheduledRound
from services.patrol.patrol import PatrolService
from t2 import keys
from t2 import messages as m
from t2.words import render
from tests.fake_bus import FakeNode
from tests.patrol.core.vehicle_fixture import LOOP, TICK_NS, Vehicle, route

ECHO = 7  # of the factory's state of safety


class Service:
    """Patrol on a fake bus, with a vehicle that does what it requests."""

    node: FakeNode[PatrolConfig]

    def __init__(self, folder: Path, wall: datetime, **settings: Any) -> None:
        self.wall = wall
        self.vehicle = Vehicle()
        self.start_service(folder, **settings)

    def start_service(self, folder: Path, **settings: Any) -> None:
        """Start the service, or start it again."""
        if hasattr(self, "node"):
            self.node.loop.close()
        usual: dict[str, Any] = {"folder": str(folder), "announce": 1.0, "patience": 20.0}
        self.node = FakeNode("patrol", PatrolConfig(patrol=Patrol(**usual | settings)))
        self.service = PatrolService(self.node)

    def run(self, seconds: float) -> None:
        """Let time pass."""
        vehicle = self.vehicle
        for _ in range(round(seconds * 1e9 / TICK_NS)):
            vehicle.now_ns += TICK_NS
            self.wall += timedelta(seconds=TICK_NS / 1e9)
            self.deliver()
            self.service._tick(vehicle.now_ns)
            _, drive = self.node.sent(keys.DRIVE)
            if drive is not None and not (vehicle.latched or vehicle.causes):
                vehicle.requests = [drive]
                vehicle.at = vehicle.at.moved(drive.linear * 0.05, drive.angular * 0.05)

    def deliver(self) -> None:
        """Deliver what safety and localization publish."""
        vehicle = self.vehicle
        vehicle.patrol = self.service._patrol
        self.node.fake.deliver(keys.SAFETY, vehicle._state(), vehicle.now_ns)
        self.node.fake.deliver(keys.MAP_POSE, vehicle._pose(), vehicle.now_ns)

    def until(self, state: m.RoundState, within: float = 90.0) -> None:
        """Let time pass until a state."""
        for _ in range(round(within * 4)):
            if self.state.state == state:
                return
            self.run(0.25)
        raise AssertionError(f"{self.state.state}: {self.state.text}")

    @property
    def state(self) -> m.PatrolState:
        """The newest published state."""
        _, message = self.node.sent(keys.PATROL)
        return message  # type: ignore[no-any-return]

    def call(self, call: keys.Call[Any, Any], **request: Any) -> Any:
        """Call the service; return the reply, or the text of the refusal."""
        answers: list[Any] = []
        caller: Any = SimpleNamespace(
            refuse=lambda *reasons: answers.append(render(reasons)), reply=answers.append
        )
        self.node.fake.served[call.path](call.request(**request), caller)
        (answer,) = answers
        return answer

    def teach(self, action: m.TeachAction, echo: int | None = ECHO, **request: Any) -> Any:
        return self.call(keys.TEACH, action=action, echo=echo, **request)

    def round(self, action: m.RoundAction, echo: int | None = ECHO, **request: Any) -> Any:
        return self.call(keys.ROUND, action=action, echo=echo, **request)


@pytest.fixture
def service(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Service]:
    made = Service(tmp_path, datetime(2026, 6, 1, 21, 59, 50, tzinfo=UTC))
    monkeypatch.setattr(clock, "now_ns", lambda: made.vehicle.now_ns)
    monkeypatch.setattr(shell, "_now", lambda: made.wall)
    made.run(0.5)
    yield made
    made.node.loop.close()


def test_teach_list_drive_and_read_the_ledger(service: Service) -> None:
    assert "Teaching" in service.teach("begin", route="yard", station="home").text
    for _ in range(200):
        service.vehicle.at = service.vehicle.at.moved(0.02, 0.0)
        service.run(0.05)
    assert "gate" in service.teach("station", station="gate").text
    assert service.state.teaching
    assert service.state.teaching.stations == ("home", "gate")
    assert "4.0 m, 2 stations" in service.teach("end").text
    (summary,) = service.call(keys.ROUTES).routes
    assert (summary.name, summary.stations) == ("yard", ("home", "gate"))
    found = service.call(keys.ROUTES, route="yard").route
    assert [each.station for each in found.points] == ["home", "gate"]
    service.vehicle.at = Vehicle().at
    service.run(0.1)
    assert "Announcing" in service.round("start", route="yard").text
    service.until("done")
    (record,) = service.call(keys.ROUNDS).rounds
    assert (record.id[-5:], record.result) == ("-yard", "home")
    whole = service.call(keys.ROUNDS, round=record.id)
    assert whole.route == found
    assert len(whole.track) > 20
    assert service.node.events == [
        "teaching", "teaching", "round_start", "station", "round_end",
    ]  # fmt: skip


@pytest.mark.parametrize("echo", [None, 1])
def test_a_call_with_an_old_echo_is_refused_unless_it_stops(
    service: Service, echo: int | None
) -> None:
    service.teach("save", points=route(LOOP))
    assert isinstance(service.round("start", route="yard", echo=echo), str)
    assert isinstance(service.teach("delete", route="yard", echo=echo), str)
    service.round("start", route="yard")
    service.run(2.0)
    assert service.state.state == "driving"
    assert isinstance(service.round("return", echo=echo), str)
    assert isinstance(service.round("pause", echo=echo), m.Done)
    assert isinstance(service.round("abort", echo=echo), m.Done)


def test_what_is_missing_in_a_call_is_named(service: Service) -> None:
    assert service.round("start") == "Name a route."
    assert service.round("start", route="none") == "There is no route none."
    assert service.teach("begin", station="home") == "Name a route."
    assert service.teach("begin", route="yard") == "Name the station."
    assert service.teach("delete", route="none") == "There is no route none."
    assert service.teach("save") == "Name a route."
    assert service.teach("end") == "No route is being taught."
    assert "idle allows: start" in service.round("resume")
    assert service.call(keys.ROUNDS, round="x") == "There is no round x in the ledger."


def test_a_route_is_not_overwritten_by_teaching_nor_changed_while_driven(service: Service) -> None:
    service.teach("save", points=route(LOOP))
    assert "exists" in service.teach("begin", route="yard", station="home")
    service.round("start", route="yard")
    assert "not over" in service.teach("delete", route="yard")
    assert "not over" in service.teach("save", points=route())
    assert "not over" in service.teach("begin", route="other", station="home")
    service.round("abort")
    assert "deleted" in service.teach("delete", route="yard").text


def test_a_round_cannot_start_while_a_route_is_taught(service: Service) -> None:
    service.teach("save", points=route(LOOP))
    service.teach("begin", route="other", station="home")
    assert service.state.actions == ()
    assert "other is being taught" in service.round("start", route="yard")
    service.teach("cancel")
    assert isinstance(service.round("start", route="yard"), m.Done)


def test_a_restarted_service_resumes_a_round_by_a_call(service: Service, tmp_path: Path) -> None:
    service.teach("save", points=route(LOOP))
    service.round("start", route="yard")
    service.run(8.0)
    before = service.state
    assert before.state == "driving"
    service.start_service(tmp_path)  # without an orderly end
    service.run(3.0)
    assert (service.state.state, service.state.round) == ("stopped", before.round)
    assert service.node.sent(keys.DRIVE)[0] == 0
    assert isinstance(service.round("resume"), m.Done)
    service.until("done")
    (record,) = service.call(keys.ROUNDS).rounds
    assert (record.id, record.result) == (before.round, "home")


def test_a_restarted_service_keeps_what_was_taught(service: Service, tmp_path: Path) -> None:
    service.teach("begin", route="yard", station="home")
    for _ in range(100):
        service.vehicle.at = service.vehicle.at.moved(0.02, 0.0)
        service.run(0.05)
    service.service._write_teaching(0)
    service.start_service(tmp_path)
    service.run(0.5)
    assert service.state.teaching
    assert "restarted" in service.state.teaching.text
    assert isinstance(service.teach("end"), m.Done)
    assert service.call(keys.ROUTES).routes[0].length == pytest.approx(2.0, abs=0.15)


def test_a_full_disk_refuses_the_start_and_keeps_the_end(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    service.teach("save", points=route())

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("services.patrol.store._replace", full)
    assert "No space left on device" in service.round("start", route="yard")
    assert (service.state.state, service.state.round) == ("idle", "")
    monkeypatch.undo()
    monkeypatch.setattr(clock, "now_ns", lambda: service.vehicle.now_ns)
    monkeypatch.setattr(shell, "_now", lambda: service.wall)
    service.round("start", route="yard")
    service.run(3.0)
    monkeypatch.setattr("services.patrol.store._replace", full)
    monkeypatch.setattr("services.patrol.store.Store._append", full)
    service.until("done")
    assert "round_unwritten" in service.node.events
    assert len(service.call(keys.ROUNDS).rounds) == 1


def test_the_schedule_starts_rounds_and_skips_with_the_reason(
    service: Service, tmp_path: Path
) -> None:
    service.teach("save", points=route())
    rows = {
        "night": ScheduledRound(route="yard", cron="0 22 * * *"),
        "twice": ScheduledRound(route="yard", cron="0 22 * * *"),
    }
    service.start_service(tmp_path, schedule=rows, timezone="UTC")
    service.run(1.0)
    assert service.state.next
    assert service.state.next.schedule == "night"
    service.run(10.0)
    service.service._check_schedule(service.vehicle.now_ns)
    service.run(0.1)
    assert sorted(service.node.events) == ["round_skipped", "round_start"]
    service.until("done")
    service.wall += timedelta(days=1, hours=8)
    service.service._check_schedule(service.vehicle.now_ns)
    assert service.node.events[-2:] == ["round_skipped", "round_skipped"]
    assert service.call(keys.ROUNDS).rounds[0].schedule == "night"


def test_the_lamp_is_lit_while_a_round_is_under_way(service: Service, tmp_path: Path) -> None:
    service.teach("save", points=route())
    service.start_service(tmp_path, lamp_channel=3, lamp_mode=2)
    service.run(0.5)
    service.round("start", route="yard")
    service.until("done")
    asked = [request for path, request in service.node.fake.asked if path == keys.SET_LED.path]
    assert [(each.channel, each.mode) for each in asked] == [(3, 0), (3, 2), (3, 0)]


def test_black_boxes_of_a_round_are_in_its_record(service: Service) -> None:
    service.teach("save", points=route())
    service.round("start", route="yard")
    event = m.Event(name="black_box", level="info", text="", about={"file": "001-latch.mcap"})
    service.node.fake.deliver(keys.EVENTS, event, service.vehicle.now_ns, service="recorder")
    service.round("abort")
    assert service.call(keys.ROUNDS).rounds[0].recordings == ("001-latch.mcap",)


def test_the_state_is_published_at_once_when_it_changes(service: Service) -> None:
    service.teach("save", points=route())
    before, _ = service.node.sent(keys.PATROL)
    service.round("start", route="yard")
    assert service.node.sent(keys.PATROL)[0] > before
    before, _ = service.node.sent(keys.PATROL)
    service.run(1.0)
    assert 4 <= service.node.sent(keys.PATROL)[0] - before <= 8
