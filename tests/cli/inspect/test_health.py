"""``t2 health``: all services by their messages, one service by its answer."""

from functools import partial

import pytest

from cli.inspect import health as command
from t2 import keys
from t2.messages import Durations
from tests.cli.inspect.tool import Tool, pretend
from tests.common.bus_fixture import BusFixture
from tests.factories import health


def test_health(buses: BusFixture, tool: Tool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command, "LISTEN_S", 1.0)
    reactions = {
        "reflex": Durations(bounds=(0.001, 0.01), counts=(98, 1, 1), worst=0.5),
        "judged_stop": Durations(bounds=(0.001, 0.01), counts=(0, 0, 0), worst=0.0),
    }
    bridge = health("bridge", counters={"overrun": 2}, priority=53, reactions=reactions)
    pretend(buses, "bridge", {keys.HEALTH: lambda: bridge}, service="bridge")
    pretend(buses, "safety", {keys.HEALTH: partial(health, "safety")}, service="safety")
    pretend(buses, "odom", {})
    pretend(buses, "recorder", {keys.HEALTH: partial(health, "safety")}, service="recorder")
    result = tool("health", text=True)
    assert result.code == 1
    rows = {line.split()[1]: line.split()[2:] for line in result.out.splitlines()[1:]}
    assert rows["bridge"] == ["ok", "0.1.0", "60", "0", "53", "50000000", "overrun=2", "reflex=0.5"]
    assert rows["odom"] == ["hangs", *"-------"]
    monkeypatch.setattr(command, "LISTEN_S", 3600.0)  # one service's first message ends it
    result = tool("health", "safety")
    assert (result.code, result.err) == (0, "")
    (line,) = result.lines
    assert (line["service"], line["state"], line["rss"]) == ("safety", "ok", 50_000_000)
    monkeypatch.setattr(command, "LISTEN_S", 1.0)
    assert [line["robot"] for line in tool("health", "safety", robot="*").lines] == [tool.robot]
    # The recorder publishes as another service.
    for name, state in (("odom", "hangs"), ("recorder", "hangs"), ("teleop", "missing")):
        result = tool("health", name)
        (line,) = result.lines
        assert (result.code, line["service"], line["state"]) == (1, name, state)
        assert f"{name} of robot {tool.robot} {command.REASONS[state]}" in result.err
    assert tool("health", "router").lines == [
        {"robot": tool.robot, "service": "router", "state": "ok"}
    ]
