"""``t2 doctor`` on the real stack with injected faults, and without a stack."""

import signal
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from cli.inspect import remedies
from cli.inspect.doctor import connect, findings
from common.settings import BusSettings, Shared
from sim.requests import Bumper, Freeze, Sonar
from tests.cli.inspect.tool import Tool
from verification.harness.bus import at, router_process
from verification.harness.ports import free_port
from verification.harness.stack import RunningStack, running_stack
from verification.harness.waiting import wait_until

TRIES_S = 30.0


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningStack]:
    with running_stack(tmp_path_factory.mktemp("doctor")) as it:
        yield it


@pytest.fixture
def doctor(stack: RunningStack, capsys: pytest.CaptureFixture[str]) -> Callable[[], "list[Any]"]:
    tool = Tool(stack.endpoint, "001", capsys)

    def diagnose() -> list[Any]:
        result = tool("doctor", "--duration", "2")
        assert result.err == ""
        assert result.code == (1 if wrong(result.lines) else 0)
        return result.lines

    return diagnose


Doctor = Callable[[], "list[Any]"]


def wrong(found: list[Any]) -> list[tuple[str, str]]:
    """Return places and remedies of the problems."""
    return [(each["where"], each["todo"]) for each in found if each["level"] == "wrong"]


def until_wrong(doctor: Doctor, where: str, todo: str) -> list[Any]:
    """Repeat the diagnosis until it finds the problem; a fault takes time to show."""
    found: list[Any] = []
    begin_s = time.monotonic()
    while (where, todo) not in wrong(found):
        assert time.monotonic() - begin_s < TRIES_S, found
        found = doctor()
    return found


def until_healthy(doctor: Doctor) -> None:
    begin_s = time.monotonic()
    while wrong(found := doctor()):
        assert time.monotonic() - begin_s < TRIES_S, found


def test_a_pressed_bumper_and_a_faulty_sonar(stack: RunningStack, doctor: Doctor) -> None:
    until_healthy(doctor)

    stack.control.do(Bumper(pressed=True))
    found = until_wrong(doctor, "bumper", remedies.BUMPER)
    assert ("safety", remedies.BUMPER) in wrong(found)
    stack.control.do(Bumper(pressed=False))
    reset(doctor, stack)

    stack.control.do(Sonar(name="rear_left", fault=True))
    found = until_wrong(doctor, "sonar", remedies.SONAR_FAULT)
    assert "the rear left sonar is faulty" in [each["text"] for each in found]
    stack.control.do(Sonar(name="rear_left"))


def reset(doctor: Doctor, stack: RunningStack) -> None:
    """Reset as the remedy describes, until safety accepts."""
    from cli.__main__ import main

    where = ["--set", f"bus.connect={stack.endpoint}"]
    wait_until(lambda: main(["call", "safety/reset", *where]) == 0, "a reset")
    until_healthy(doctor)


def test_a_frozen_board(stack: RunningStack, doctor: Doctor) -> None:
    stack.control.do(Freeze(seconds=3600.0))
    found = until_wrong(doctor, "link", remedies.BOARD_LOST)
    assert any(each["where"] == "sensors" and each["level"] == "unknown" for each in found)
    stack.control.do(Freeze(seconds=0.0))


def test_missing_services_and_their_return(stack: RunningStack, doctor: Doctor) -> None:
    # The router drops a stopped process, but not one whose loop hangs.
    stack.processes["odom"].send_signal(signal.SIGSTOP)
    begin_s = time.monotonic()
    while not wrong(found := doctor()):
        assert time.monotonic() - begin_s < TRIES_S, found
    assert any(each["text"].startswith("odom is") for each in found if each["level"] == "wrong")
    stack.processes["odom"].send_signal(signal.SIGCONT)
    stack.processes["bridge"].terminate()
    stack.processes["bridge"].wait()
    found = until_wrong(doctor, "services", remedies.START)
    assert ("link", "unknown") in {(each["where"], each["level"]) for each in found}
    stack.start("bridge")
    until_healthy(doctor)


# --- without a stack --------------------------------------------------------------------------


def test_no_router(capsys: pytest.CaptureFixture[str]) -> None:
    result = Tool(f"tcp/127.0.0.1:{free_port()}", "001", capsys)("doctor", "--text")
    assert (result.code, result.err) == (1, "")
    lines = result.out.splitlines()
    assert "WRONG" in lines[0]
    assert "connection refused" in lines[0]
    assert lines[1].strip() == f"-> {remedies.REFUSED}"
    assert lines[-1] == "1 problem found."


def test_a_router_without_services(capsys: pytest.CaptureFixture[str]) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with router_process(endpoint):
        result = Tool(endpoint, "001", capsys)("doctor", "--duration", "0.2")
    assert result.code == 1
    assert wrong(result.lines) == [("services", remedies.START)] * 3


def test_an_endpoint_that_is_not_a_router(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        result = Tool(f"tcp/127.0.0.1:{port}", "001", capsys)("doctor")
    assert wrong(result.lines) == [("router", remedies.NOT_A_ROUTER)]


def test_endpoints_of_every_kind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert connect("udp/127.0.0.1:7447", at()).level == "unknown"
    assert connect(f"unixsock-stream/{tmp_path}/no.sock", at()).todo == remedies.NO_SOCKET
    assert connect(f"unixsock-stream/{tmp_path}", at()).level == "ok"
    with socket.create_server(("127.0.0.1", 0)) as server:
        assert connect(f"tcp/127.0.0.1:{server.getsockname()[1]}?so_rcvbuf=1", at()).level == "ok"
    for error, todo in (
        (socket.gaierror(), remedies.NO_NAME),
        (TimeoutError(), remedies.NO_ROUTE),
        (OSError(101, "Network is unreachable"), remedies.NO_ROUTE),
    ):

        def fail(*_: object, error: OSError = error) -> None:
            raise error

        monkeypatch.setattr(socket, "create_connection", fail)
        found = connect("tcp/robot:7447", at())
        assert (found.level, found.todo) == ("wrong", todo)


def test_one_reachable_endpoint_is_enough() -> None:
    reached, absent = (f"tcp/127.0.0.1:{free_port()}" for _ in range(2))
    with router_process(reached):
        config = Shared(bus=BusSettings(connect=(absent, reached)))
        first, second, *_ = findings(config, 0.1)
    assert (first.level, first.todo) == ("note", remedies.REFUSED)
    assert (second.where, second.level) == ("network", "ok")
