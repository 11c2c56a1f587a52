"""On which keys a tool may speak."""

from functools import partial

import pytest

from cli.inspect import permission
from cli.inspect.permission import is_loopback, reason
from common import keys
from common.messages import Drive, Link
from tests.cli.inspect.tool import Tool, pretend
from tests.common.bus_fixture import Rig
from verification.harness.waiting import wait_until

ROOT = "t2/v1/001"


@pytest.mark.parametrize("topic", keys.TOPICS)
def test_no_key_of_the_robot_s_own_services(topic: keys.Topic[Drive]) -> None:
    key = topic.on("001", service="safety", side="left", source="web")
    assert reason(key)


@pytest.mark.parametrize("path", ["tel/mine/x", "evt/mine", "tel/teleop/health", "tel/bridge2/x"])
def test_keys_of_one_s_own(path: str) -> None:
    assert reason(f"{ROOT}/{path}") == ""


@pytest.mark.parametrize("path", ["@cmd/motion", "@cmd/drive/x", "@cmd/new", "a/@cmd/b"])
def test_no_command(path: str) -> None:
    assert reason(f"{ROOT}/{path}") == "moves the wheels"


@pytest.mark.parametrize(
    ("board", "simulated"),
    [
        ("127.0.0.1:4003", True), ("[::1]:4003", True), ("10.7.5.224:4002", False),
        ("0.0.0.0:1", False), ("localhost:1", False), ("", False), ("127.0.0.1.evil:1", False),
    ],
)  # fmt: skip
def test_whose_board_is_a_simulated_one(board: str, simulated: bool) -> None:
    assert is_loopback(board) is simulated


def link(board: str) -> Link:
    return Link(
        state="up", board=board, epoch=0, armed=True, waiting="", rates={}, rejected={},
        round_trip=None,
    )  # fmt: skip


def commands(rig: Rig) -> list[Drive]:
    """Hear what is asked on any source."""
    heard: list[Drive] = []
    rig.bus(lambda bus: bus.subscribe(keys.DRIVE, lambda a: heard.append(a.message), source="*"))
    return heard


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(permission, "LOOK_S", 0.5)


ASKED = ("pub", "@cmd/drive/web", '{"linear": 0.1, "angular": 0, "echo": 3}', "--once")


def test_a_command_is_refused(rig: Rig, tool: Tool) -> None:
    heard = commands(rig)
    pretend(rig, "bridge", {keys.LINK: lambda: link("127.0.0.1:4003")})
    result = tool(*ASKED)
    assert (result.code, result.out, heard) == (1, "", [])
    assert "@cmd/drive/web moves the wheels" in result.err
    assert "t2 drive" in result.err


@pytest.mark.parametrize("boards", [["10.7.5.224:4002"], ["127.0.0.1:4003", "10.7.5.224:4002"], []])
def test_a_command_for_a_simulator_never_reaches_a_real_board(
    rig: Rig, tool: Tool, boards: list[str]
) -> None:
    heard = commands(rig)
    for board in boards:
        pretend(rig, "bridge", {keys.LINK: partial(link, board)})
    result = tool(*ASKED, "--simulator")
    assert (result.code, result.out, heard) == (1, "", [])
    assert ("a real one" if boards else "no bridge") in result.err


def test_a_command_for_a_simulator(rig: Rig, tool: Tool) -> None:
    heard = commands(rig)
    pretend(rig, "bridge", {keys.LINK: lambda: link("127.0.0.1:4003")})
    assert tool(*ASKED, "--simulator").code == 0
    wait_until(lambda: heard, "the command")
    assert [(each.linear, each.echo) for each in heard] == [(0.1, 3)]
