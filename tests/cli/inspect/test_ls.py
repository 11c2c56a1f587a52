"""``t2 ls`` and ``t2 hz`` on a real router with simulated services."""

import pytest

from cli.inspect import hz, ls
from common.bus.bus import Bus
from common.bus.session import router
from t2 import keys
from t2.messages import Bumper, Velocity
from tests.cli.inspect.tool import Tool, pretend
from tests.common.bus_fixture import BusFixture
from verification.harness.bus import listening
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until


@pytest.fixture
def bridge(buses: BusFixture) -> Bus:
    return pretend(buses, "bridge", {keys.BUMPER: lambda: Bumper(pressed=True)})


def test_keys_and_services_with_publishers_and_readers(
    buses: BusFixture, bridge: Bus, tool: Tool
) -> None:
    pretend(buses, "safety", {}, lambda bus: bus.subscribe(keys.BUMPER, lambda _: None))
    stranger, member = buses.session(), buses.session()
    root = keys.app_key(buses.robot, "planner")
    token = member.liveliness().declare_token(f"{root}/1")  # names its session
    route = member.declare_publisher(f"{root}/route", encoding="image/jpeg")

    def put(_: int) -> None:
        stranger.put(f"t2/v1/{buses.robot}/tel/x", b"\x01")
        route.put(b"\xff\xd8")

    buses.loop.post(lambda: buses.loop.every(0.1, put))
    found = {line["key"]: line for line in tool("ls", "--duration", "1").lines}
    shown = {key: (row["type"], row["publishers"], row["readers"]) for key, row in found.items()}
    assert shown == {
        "tel/bridge/bumper": ("Bumper", ["bridge"], ["safety"]),
        "tel/x": ("", [], []),
        "app/planner/route": ("image/jpeg", ["app/planner"], []),
    }
    assert found["tel/bridge/bumper"]["hz"] > 1
    _, line = tool("ls", "bumper", "--duration", "0.5", text=True).out.splitlines()
    key, kind, _, publisher, reader = line.split()
    assert (key, kind, publisher, reader) == ("tel/bridge/bumper", "Bumper", "bridge", "safety")
    name = f"bridge/{bridge.boot:x}"
    declared = tool("ls", "--services").lines
    assert {"session": name, "does": "publishes", "key": "tel/bridge/bumper"} in declared
    readers = [row["session"] for row in declared if row["does"] == "reads"]
    assert [name.partition("/")[0] for name in readers] == ["safety"]
    token.undeclare()


def test_services_of_a_robot_that_dials_a_site(capsys: pytest.CaptureFixture[str]) -> None:
    """Its router is a peer and not listed as a member, neither on board nor at the site."""
    own, site = (f"tcp/127.0.0.1:{free_port()}" for _ in range(2))

    def found(place: str) -> list[dict[str, str]]:
        return Tool(place, "berlin-001", capsys)("ls", "--services").lines

    with router(listening(site)), router(listening(own, site)), BusFixture(own) as buses:
        buses.robot = "berlin-001"
        bus = pretend(buses, "bridge", {keys.VELOCITY: lambda: Velocity(linear=0.5, angular=0.0)})
        name = f"bridge/{bus.boot:x}"
        alone = [{"session": name, "does": "publishes", "key": "tel/bridge/velocity"}]
        wait_until(lambda: found(own) == found(site) == alone, "the bridge alone")


def test_figures_of_a_key(bridge: Bus, tool: Tool) -> None:
    result = tool("hz", "tel/**", "--duration", "0.5")
    assert (result.code, result.err) == (0, "")
    line = result.lines[-1]
    assert (line["key"], line["lost"]) == ("tel/bridge/bumper", 0)
    assert line["bytes_per_s"] == pytest.approx(line["bytes"] * line["hz"], rel=0.1)
    assert 0 < line["delay_p50"] <= line["delay_p99"] < 5
    head, row, *_ = tool("hz", "bumper", "--duration", "0.5", text=True).out.splitlines()
    assert len(row.split()) == len(head.split()) == len(line)


def test_silence_is_reported(tool: Tool, monkeypatch: pytest.MonkeyPatch) -> None:
    for words, reason in (((), "no active key on"), (("--services",), "no service found")):
        result = tool("ls", "--duration", "0.2", *words)
        assert (result.code, result.out) == (1, "")
        assert reason in result.err
    monkeypatch.setattr(hz, "REPORT_S", 0.05)
    result = tool("hz", "tel/none", "--duration", "0.3")
    assert (result.code, result.out) == (1, "")
    assert result.err.count("t2 hz: no new messages") > 2
    assert "no message on" in result.err


def test_a_closed_admin_space_is_reported(
    bridge: Bus, tool: Tool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ls, "ADMIN", "@/none/*/*/t2/v1/{robot}/**")
    result = tool("ls", "--duration", "0.5")
    assert result.code == 0
    assert result.lines[0]["publishers"] == []
    assert "the router shows no declarations" in result.err
