"""Commands without a router, without a publisher, and with an unencodable message."""

import contextlib
import threading

import pytest

from cli.inspect import echo, estop
from common.cli_args import EXIT_LINK
from tests.cli.inspect.tool import Tool
from verification.harness.bus import router_process
from verification.harness.ports import free_port


@pytest.mark.parametrize("word", ["ls", "services", "health", "estop"])
def test_without_a_router(word: str, tool: Tool) -> None:
    nowhere = Tool(f"tcp/127.0.0.1:{free_port()}", "001", tool.capsys)
    result = nowhere(word)
    assert (result.code, result.out) == (EXIT_LINK, "")
    assert f"no router answers at {nowhere.endpoint}" in result.err
    assert "t2 doctor" in result.err


@pytest.mark.parametrize("words", [("estop",), ("pub", "estop")])
def test_an_unsent_stop_names_the_switch(
    words: tuple[str, ...], tool: Tool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(estop, "TIMEOUT_S", 0.1)
    result = Tool(f"tcp/127.0.0.1:{free_port()}", "001", tool.capsys)(*words)
    assert (result.code, result.out) == (EXIT_LINK, "")
    assert "NOT SENT, USE THE VEHICLE'S OWN SWITCH" in result.err


def test_a_stop_waits_for_a_restarted_router(tool: Tool) -> None:
    where = f"tcp/127.0.0.1:{free_port()}"
    with contextlib.ExitStack() as stack:
        late = threading.Timer(1.0, lambda: stack.enter_context(router_process(where)))
        late.start()
        result = Tool(where, "001", tool.capsys)("estop")
        late.join()
    assert "sent, but safety of robot 001 does not confirm" in result.err


def test_a_number_beyond_messagepack_is_refused(tool: Tool) -> None:
    result = tool("pub", "tel/mine/x", '{"a": 99999999999999999999999}')
    assert result.code == 2
    assert "MessagePack cannot encode it" in result.err


def test_echo_reports_that_no_message_arrived_yet(
    tool: Tool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(echo, "FIRST_S", 0.1)
    result = tool("echo", "tel/nothing", "--duration", "0.3")
    assert result.code == 1
    assert "yet; waiting" in result.err
