"""The dashboard under systemd: readiness and the watchdog of both loops."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from common.loop import Loop
from common.systemd import Systemd
from services.dashboard.host import Host
from tests.common.systemd_manager import Manager
from verification.harness.dashboard import dashboard
from verification.harness.waiting import PATIENCE_S, wait_until


@pytest.fixture
def manager(tmp_path: Path) -> Iterator[Manager]:
    with contextlib.closing(Manager(str(tmp_path / "notify"))) as made:
        yield made


def test_the_service_is_ready_once_it_serves(
    manager: Manager, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("NOTIFY_SOCKET", "WATCHDOG_USEC"):
        monkeypatch.setenv(name, manager.environ[name])
    with dashboard("tcp/127.0.0.1:1", tmp_path):
        wait_until(lambda: manager.beats() > 1, "beats", 2 * PATIENCE_S)
        assert manager.messages[0] == "READY=1"
    assert manager.read()[-1] == "STOPPING=1"


def test_both_loops_must_run_for_a_notification(manager: Manager) -> None:
    host = Host.__new__(Host)
    with contextlib.closing(Loop()) as loop:
        host.__dict__.update(_node=SimpleNamespace(loop=loop), _systemd=Systemd(manager.environ))
        host._alive()
        assert manager.read() == []
        loop.post(loop.stop)
        loop.run()
        assert manager.read() == ["READY=1", "WATCHDOG=1"]
