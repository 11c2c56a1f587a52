"""Notifications to systemd, on a real notification socket."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from common.freshness import NS_PER_S
from common.systemd import BEATS_PER_TIMEOUT, Systemd
from tests.common.systemd_manager import PATIENCE_US, Manager

PERIOD_NS = PATIENCE_US * 1000 // BEATS_PER_TIMEOUT


@pytest.fixture
def manager(tmp_path: Path) -> Iterator[Manager]:
    with contextlib.closing(Manager(str(tmp_path / "notify"))) as made:
        yield made


def test_ready_is_said_once_and_beats_when_they_are_due(manager: Manager) -> None:
    systemd = Systemd(manager.environ)
    assert systemd.enabled
    for now_ns in (0, 1, PERIOD_NS - 1, PERIOD_NS, PERIOD_NS + 1, 5 * PERIOD_NS):
        systemd.ready(now_ns)
    systemd.stopping()
    beat = "WATCHDOG=1"
    assert manager.read() == ["READY=1", beat, beat, beat, "STOPPING=1"]


def test_an_abstract_socket_is_found_by_its_name() -> None:
    name = f"@t2-test-{os.getpid()}"
    with contextlib.closing(Manager(name)) as manager:
        Systemd(manager.environ).ready(0)
        assert manager.read()[0] == "READY=1"


@pytest.mark.parametrize(
    "watchdog",
    [{}, {"WATCHDOG_USEC": "soon"}, {"WATCHDOG_USEC": "200000", "WATCHDOG_PID": "1"}],
)
def test_no_beat_where_nobody_waits_for_ours(manager: Manager, watchdog: dict[str, str]) -> None:
    systemd = Systemd({"NOTIFY_SOCKET": manager.environ["NOTIFY_SOCKET"]} | watchdog)
    systemd.ready(0)
    systemd.ready(100 * NS_PER_S)
    assert manager.read() == ["READY=1"]


@pytest.mark.timeout(20)  # a send that waits for space would block indefinitely
def test_a_full_socket_delays_nobody_and_ready_is_sent_until_it_is_taken(manager: Manager) -> None:
    systemd = Systemd(manager.environ)
    for n in range(2000):  # more than a queue takes
        systemd.beat(n * NS_PER_S)
    systemd.stopping()
    systemd.ready(3000 * NS_PER_S)
    assert set(manager.read()) == {"WATCHDOG=1"}
    assert len(manager.messages) < 2000
    systemd.ready(3001 * NS_PER_S)
    systemd.ready(3002 * NS_PER_S)
    assert manager.read().count("READY=1") == 1


@pytest.mark.timeout(20)
def test_a_socket_that_is_gone_holds_nobody_up(manager: Manager) -> None:
    systemd = Systemd(dict(manager.environ))
    manager.close()  # nobody enabled
    systemd.ready(0)
    place = Path(manager.environ["NOTIFY_SOCKET"])
    place.unlink()
    systemd.ready(NS_PER_S)
    with contextlib.closing(Manager(str(place))) as successor:
        systemd.ready(2 * NS_PER_S)
        systemd.stopping()
        assert successor.read() == ["READY=1", "WATCHDOG=1", "STOPPING=1"]
