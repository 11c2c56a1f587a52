"""``t2 health``: all services by their messages, one service by its answer."""

from functools import partial

import msgspec
import pytest

from cli.inspect import health as command
from common import keys
from common.messages import Durations, Health
from tests.cli.inspect.tool import Tool, health, pretend
from tests.common.bus_fixture import BusFixture


def test_health(buses: BusFixture, tool: Tool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command, "LISTEN_S", 1.0)
    reactions = {
        "reflex": Durations(bounds=(0.001, 0.01), counts=(98, 1, 1), worst=0.5),
        "judged_stop": Durations(bounds=(0.001, 0.01), counts=(0, 0, 0), worst=0.0),
    }

    def measured() -> Health:
        return msgspec.structs.replace(health("bridge"), reactions=reactions)

    pretend(buses, "bridge", {keys.HEALTH: measured}, service="bridge")
    pretend(buses, "safety", {keys.HEALTH: partial(health, "safety")}, service="safety")
    pretend(buses, "odom", {})
    result = tool("health", text=True)
    assert result.code == 1
    rows = {line.split()[1]: line.split()[2:] for line in result.out.splitlines()[1:]}
    assert rows["bridge"] == ["ok", "1", "3", "0", "53", "5000000", "overrun=2", "reflex=0.5"]
    assert rows["odom"] == ["hangs", *"-------"]
    assert "odom of robot" in result.err
    assert "it hangs" in result.err


def test_one_service(buses: BusFixture, tool: Tool, monkeypatch: pytest.MonkeyPatch) -> None:
    pretend(buses, "safety", {keys.HEALTH: partial(health, "safety")}, service="safety")
    pretend(buses, "bridge", {keys.HEALTH: partial(health, "safety")}, service="bridge")
    pretend(buses, "odom", {})
    result = tool("health", "safety")
    assert (result.code, result.err) == (0, "")
    (line,) = result.lines
    assert (line["service"], line["state"], line["rss"]) == ("safety", "ok", 5_000_000)
    monkeypatch.setattr(command, "LISTEN_S", 0.3)
    assert [line["robot"] for line in tool("health", "safety", robot="*").lines] == [tool.robot]
    # The bridge publishes as another service.
    for name, state in (("odom", "hangs"), ("bridge", "hangs"), ("recorder", "missing")):
        result = tool("health", name)
        assert (result.code, result.lines[0]["state"]) == (1, state)
        assert f"{name} of robot {tool.robot} {command.REASONS[state]}" in result.err
    assert tool("health", "router").lines == [
        {"robot": tool.robot, "service": "router", "state": "ok"}
    ]
