"""Keys that a tool may publish on."""

from functools import partial

import pytest

from cli.inspect import pub
from cli.inspect.pub import is_loopback, refused
from common import keys
from common.messages import Drive
from tests.cli.inspect.tool import Tool, pretend
from tests.common.bus_fixture import BusFixture
from tests.factories import link
from verification.harness.waiting import wait_until

ROOT = "t2/v1/001"


@pytest.mark.parametrize("topic", keys.TOPICS)
def test_keys_of_own_services_are_refused(topic: keys.Topic[Drive]) -> None:
    key = topic.on("001", service="safety", side="left", source="web")
    assert refused(key)


@pytest.mark.parametrize("path", ["tel/mine/x", "evt/mine", "tel/teleop/health", "tel/bridge2/x"])
def test_other_keys_are_allowed(path: str) -> None:
    assert refused(f"{ROOT}/{path}") == ""


@pytest.mark.parametrize("path", ["@cmd/motion", "@cmd/drive/x", "@cmd/new", "a/@cmd/b"])
def test_commands_are_refused(path: str) -> None:
    assert refused(f"{ROOT}/{path}") == "moves the wheels"


@pytest.mark.parametrize(
    ("board", "simulated"),
    [
        ("127.0.0.1:4003", True), ("[::1]:4003", True), ("10.7.5.224:4002", False),
        ("0.0.0.0:1", False), ("localhost:1", False), ("", False), ("127.0.0.1.evil:1", False),
    ],
)  # fmt: skip
def test_simulated_boards(board: str, simulated: bool) -> None:
    assert is_loopback(board) is simulated


def commands(buses: BusFixture) -> list[Drive]:
    """Collect the requests of any source."""
    received: list[Drive] = []
    buses.bus(
        lambda bus: bus.subscribe(keys.DRIVE, lambda a: received.append(a.message), source="*")
    )
    return received


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pub, "LINK_S", 0.5)


ASKED = ("pub", "@cmd/drive/web", '{"linear": 0.1, "angular": 0, "echo": 3}', "--once")


def test_a_command_is_refused(buses: BusFixture, tool: Tool) -> None:
    received = commands(buses)
    pretend(buses, "bridge", {keys.LINK: lambda: link(board="127.0.0.1:4003")})
    result = tool(*ASKED)
    assert (result.code, result.out, received) == (1, "", [])
    assert "@cmd/drive/web moves the wheels" in result.err
    assert "t2 drive" in result.err


@pytest.mark.parametrize("boards", [["10.7.5.224:4002"], ["127.0.0.1:4003", "10.7.5.224:4002"], []])
def test_a_command_for_a_simulator_never_reaches_a_real_board(
    buses: BusFixture, tool: Tool, boards: list[str]
) -> None:
    received = commands(buses)
    for board in boards:
        pretend(buses, "bridge", {keys.LINK: partial(link, board=board)})
    result = tool(*ASKED, "--simulator")
    assert (result.code, result.out, received) == (1, "", [])
    assert ("a real one" if boards else "no bridge") in result.err


def test_a_command_for_a_simulator(buses: BusFixture, tool: Tool) -> None:
    received = commands(buses)
    pretend(buses, "bridge", {keys.LINK: lambda: link(board="127.0.0.1:4003")})
    assert tool(*ASKED, "--simulator").code == 0
    wait_until(lambda: received, "the command")
    assert [(each.linear, each.echo) for each in received] == [(0.1, 3)]
