"""Requests to move, with the echo of safety's heartbeat."""

import pytest

from common.bus.bus import Bus
from common.bus.publisher import Publisher
from common.loop import Loop
from common.source import DriveSource
from t2 import keys
from t2.client import DENIED_AFTER
from tests.factories import safety_state
from tests.fake_bus import FakeBus
from verification.harness.bus import bus_on, running
from verification.harness.waiting import wait_until


@pytest.mark.parametrize(("passed_on", "denied"), [(False, True), (True, False), (None, False)])
def test_who_may_only_watch_is_denied(
    monkeypatch: pytest.MonkeyPatch, passed_on: bool | None, denied: bool
) -> None:
    bus = FakeBus()
    monkeypatch.setattr(Publisher, "passed_on", passed_on)
    reported: list[str] = []
    source = DriveSource(bus, "demo", lambda: reported.append("denied"))
    for _ in range(DENIED_AFTER - 1):
        bus.deliver(keys.SAFETY, safety_state(heartbeat=7))
    assert not source.denied
    for _ in range(DENIED_AFTER):
        bus.deliver(keys.SAFETY, safety_state(heartbeat=8))
    assert source.denied is denied
    assert reported == ["denied"] * denied
    monkeypatch.setattr(Publisher, "passed_on", True)
    bus.deliver(keys.SAFETY, safety_state(heartbeat=9))
    assert not source.denied


def test_a_subscriber_of_the_same_session_is_no_permission(shared_router: str) -> None:
    sources: list[DriveSource] = []

    def declare(bus: Bus) -> None:
        sources.append(DriveSource(bus, "web"))
        bus.subscribe(keys.DRIVE, lambda _: None, source="*")

    loop = Loop()
    with (
        running(loop),
        bus_on(shared_router, loop, lambda _: None) as safety,
        bus_on(shared_router, loop, declare),
    ):
        state = safety.publisher(keys.SAFETY)

        def published() -> bool:
            state.put(safety_state(heartbeat=1))
            return sources[0].denied

        wait_until(published, "the missing subscriber is noticed")
        safety.subscribe(keys.DRIVE, lambda _: None, source="*")
        wait_until(lambda: not published(), "the subscriber of safety is noticed")
