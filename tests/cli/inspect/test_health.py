"""``t2 health``: all services by their messages, one service by its answer."""

import threading
from functools import partial

import msgspec
import pytest

from cli.inspect import health as command
from common import keys
from common.bus.bus import Bus
from common.messages import Durations, Health
from tests.cli.inspect.tool import Tool, health, pretend
from tests.common.bus_fixture import BusFixture


def test_health(buses: BusFixture, tool: Tool) -> None:
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
    *table, last = result.out.splitlines()
    rows = {line.split()[1]: line.split()[2:] for line in table[1:]}
    assert rows["bridge"] == ["ok", "1", "0m03s", "0.0", "53", "5", "0", "overrun=2"]
    assert rows["odom"] == ["hangs"]
    measure = "reflex measured 100 times, worst 500.00 ms"
    assert last == f"bridge of robot {buses.robot}: {measure}"
    assert "odom of robot" in result.err
    assert "it hangs" in result.err


@pytest.fixture
def answers() -> dict[str, bytes]:
    """Safety's answers to a query for its last messages, by robot."""
    return {}


@pytest.fixture
def safety(buses: BusFixture, answers: dict[str, bytes]) -> Bus:
    last = {keys.HEALTH.on(buses.robot, service="safety"): health("safety"), "another": None}
    answers[buses.robot] = msgspec.json.encode(last)

    def answer(bus: Bus) -> None:
        key = keys.info_key(buses.robot, "safety", "last")
        bus.answer(key, lambda: answers[buses.robot], "application/json")

    return pretend(buses, "safety", {}, answer)


def test_query_of_one_service(safety: Bus, tool: Tool) -> None:
    result = tool("health", "safety")
    assert (result.code, result.err) == (0, "")
    (line,) = result.lines
    assert (line["service"], line["alive"], line["told"], line["rss"]) == (
        "safety", True, True, 5_000_000,
    )  # fmt: skip
    shown = tool("health", "safety", text=True).out.splitlines()[1]
    assert shown.split()[1:4] == ["safety", "ok", "1"]
    assert [line["robot"] for line in tool("health", "safety", robot="*").lines] == [tool.robot]


@pytest.mark.parametrize(
    ("payload", "problem"),
    [
        (b"{}", ""),  # in its first second
        (b"\xff", "answers with an invalid health message"),
        (b'{"KEY": {"service": 1}}', "answers with an invalid health message"),
    ],
)
def test_an_answer_without_health(
    payload: bytes, problem: str, safety: Bus, tool: Tool, answers: dict[str, bytes]
) -> None:
    key = keys.HEALTH.on(tool.robot, service="safety")
    answers[tool.robot] = payload.replace(b"KEY", key.encode())
    result = tool("health", "safety")
    assert (result.code, result.lines[0]["alive"]) == (bool(problem), not problem)
    assert not result.lines[0]["told"]
    assert problem in result.err


def test_an_absent_service_and_one_with_a_blocked_loop(
    buses: BusFixture, safety: Bus, tool: Tool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(command, "ANSWER_S", 0.3)
    end = threading.Event()

    def hang() -> None:
        end.wait(20.0)

    buses.loop.post(hang)
    for name in ("odom", "safety"):
        result = tool("health", name)
        assert (result.code, result.lines[0]["alive"]) == (1, False)
        assert f"{name} of robot {tool.robot} does not answer" in result.err
    end.set()


def test_health_of_the_router(tool: Tool) -> None:
    result = tool("health", "router", text=True)
    assert (result.code, result.err) == (0, "")
    assert result.out.splitlines()[1].split() == [tool.robot, "router", "ok"]
