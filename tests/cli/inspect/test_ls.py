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
    stranger, key = buses.session(), f"t2/v1/{buses.robot}/tel/x"
    buses.loop.post(lambda: buses.loop.every(0.1, lambda _: stranger.put(key, b"\x01")))
    found = {line["key"]: line for line in tool("ls", "--duration", "1").lines}
    assert found.keys() == {"tel/bridge/bumper", "tel/x"}
    row = found["tel/bridge/bumper"]
    assert row["type"] == "Bumper"
    assert row["hz"] > 1
    assert (row["publishers"], row["readers"]) == (["bridge"], ["safety"])
    assert found["tel/x"]["type"] == ""
    shown = tool("ls", "bumper", "--duration", "0.5", text=True).out.splitlines()
    assert shown[0].split() == ["key", "type", "hz", "publishers", "readers"]
    assert shown[1].split()[0] == "tel/bridge/bumper"
    assert shown[1].split()[3:] == ["bridge", "safety"]
    name = f"bridge/{bridge.boot:x}"
    declared = tool("ls", "--services").lines
    assert {"session": name, "does": "publishes", "key": "tel/bridge/bumper"} in declared
    readers = [row["session"] for row in declared if row["does"] == "reads"]
    assert [name.partition("/")[0] for name in readers] == ["safety"]
    text = tool("ls", "--services", text=True).out.splitlines()
    assert [name, "publishes", "tel/bridge/bumper"] in [line.split() for line in text]


def test_own_keys_of_a_member(buses: BusFixture, tool: Tool) -> None:
    """With their encoding; a liveliness token below them names the session."""
    root = keys.app_key(buses.robot, "planner")
    session = buses.session()
    token = session.liveliness().declare_token(f"{root}/1")
    publisher = session.declare_publisher(f"{root}/route", encoding="image/jpeg")
    buses.loop.post(lambda: buses.loop.every(0.1, lambda _: publisher.put(b"\xff\xd8")))
    (row,) = tool("ls", "app/**", "--duration", "1").lines
    assert (row["key"], row["type"]) == ("app/planner/route", "image/jpeg")
    assert row["publishers"] == ["app/planner"]
    (echoed,) = tool("echo", "app/planner/route", "--once").lines
    assert (echoed["type"], echoed["message"]) == ("image/jpeg", "ffd8")
    assert "complaint" not in echoed
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
    head, row = tool("hz", "bumper", "--duration", "0.5", text=True).out.splitlines()[:2]
    assert row.split()[0] == "tel/bridge/bumper"
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
