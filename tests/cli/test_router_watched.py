"""``t2 router`` under systemd: it is there when it answers, and beats while it does."""

import contextlib
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from cli.__main__ import main
from common.bus.session import READERS_ENV
from tests.cli.processes import PATIENCE_S
from tests.common.manager import Manager
from tests.support import free_port, router_process, wait_until


@pytest.fixture
def manager(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Manager]:
    with contextlib.closing(Manager(str(tmp_path / "notify"))) as made:
        for name in ("NOTIFY_SOCKET", "WATCHDOG_USEC"):
            monkeypatch.setenv(name, made.environ[name])
        yield made


def test_it_is_ready_when_it_answers_and_beats_from_then_on(manager: Manager) -> None:
    with router_process(f"tcp/127.0.0.1:{free_port()}") as process:
        wait_until(lambda: manager.beats() > 2, "beats")
        assert manager.told[0] == "READY=1"
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE_S) == 0
    assert manager.hear()[-1] == "STOPPING=1"


def test_one_that_does_not_answer_gives_no_beat(
    manager: Manager, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[None] = []

    def answers() -> bool:
        asked.append(None)
        if len(asked) == 3:
            os.kill(os.getpid(), signal.SIGTERM)
        return False

    @contextlib.contextmanager
    def deaf(*_: object) -> Iterator[Callable[[], bool]]:
        yield answers

    monkeypatch.setenv(READERS_ENV, "")  # which it sets for this process
    monkeypatch.setattr("cli.router.router", deaf)
    monkeypatch.setattr("cli.router.LOOK_S", 0.01)
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        assert main(["router"]) == 0
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    assert len(asked) == 3
    assert manager.hear() == ["STOPPING=1"]
