"""Commands that publish, call and stop, on a real router."""

import pytest

from cli.inspect import estop
from common import keys
from common.bus.bus import Bus, Caller
from common.messages import Cause, Done, LedRequest, Limits, SafetyState
from tests.cli.inspect.tool import Tool, pretend
from tests.common.bus_fixture import BusFixture
from verification.harness.waiting import wait_until


def state(*latched: str) -> SafetyState:
    causes = tuple(Cause(name=n, action="brake", age=0.0, text=n) for n in latched)
    return SafetyState(
        verdict="brake", latched=latched, causes=causes, source=None, heartbeat=1, text="",
        limits=Limits(forward=0, backward=0, angular=0),
    )  # fmt: skip


def test_pub_fills_in_the_header(buses: BusFixture, tool: Tool) -> None:
    watched: list[tuple[bytes, str]] = []
    session = buses.session()
    subscriber = session.declare_subscriber(
        f"t2/v1/{buses.robot}/tel/mine/t",
        lambda sample: watched.append((sample.payload.to_bytes(), str(sample.encoding))),
    )
    result = tool("pub", "tel/mine/t", '{"celsius": 21.5}', "--rate", "50", "--times", "2")
    assert (result.code, result.err) == (0, "")
    assert [(line["published"], line["reader"]) for line in result.lines] == [(1, True), (2, True)]
    wait_until(lambda: len(watched) == 2, "both messages")
    from cli.inspect.payload import read

    values = [read(*each).value for each in watched]
    assert [(each["celsius"], each["seq"] > 0) for each in values] == [(21.5, True)] * 2
    assert values[1]["seq"] == values[0]["seq"] + 1
    subscriber.undeclare()


def test_pub_reports_a_missing_reader(tool: Tool) -> None:
    result = tool("pub", "tel/mine/t", "--once", "--text")
    assert (result.code, result.out) == (0, "published 1 on tel/mine/t, no reader\n")
    assert "no reader on tel/mine/t" in result.err


@pytest.mark.parametrize(
    ("words", "phrase"),
    [
        (("pub", "tel/*", "{}"), "matches several keys"),
        (("pub", "tel/mine", "{"), "is not JSON"),
        (("pub", "tel/mine", "[1]"), "is not an object"),
        (("pub", "tel/mine/health", '{"service": 1}'), "not a Health"),
        (("pub", "tel/mine", "--rate", "0"), "--rate"),
        (("echo", "tel//x"), "is not a key"),
        (("echo", "tel/x", "--count", "0"), "--count"),
        (("hz", "tel/x", "--duration", "nan"), "--duration"),
        (("call", "bridge/led", '{"chanel": 1}'), "not a LedRequest"),
    ],
)
def test_invalid_arguments(words: tuple[str, ...], phrase: str, tool: Tool) -> None:
    result = tool(*words)
    assert (result.code, result.out) == (2, "")
    assert phrase in result.err


@pytest.mark.parametrize("words", [("call", "safety/reset"), ("pub", "tel/mine"), ("doctor",)])
def test_commands_for_one_robot(words: tuple[str, ...], tool: Tool) -> None:
    result = tool(*words, robot="*")
    assert (result.code, result.out) == (2, "")
    assert "one robot at a time" in result.err


def test_call(buses: BusFixture, tool: Tool) -> None:
    def led(request: LedRequest, caller: Caller[Done]) -> None:
        if request.channel:
            caller.refuse("no such lamp")
        else:
            caller.reply(Done(text="lit"))

    pretend(buses, "bridge", {keys.SAFETY: state}, lambda bus: bus.serve(keys.SET_LED, led))
    whole = f"t2/v1/{buses.robot}/srv/bridge/led"
    first = '{"channel": 0, "mode": 1}'
    for key in ("led", "bridge/led", "/srv/bridge/led", whole):
        result = tool("call", key, first)
        assert (result.code, result.lines) == (0, [{"text": "lit", "boot": 0}])
    assert tool("call", "bridge/led", first, "--text").out == "text: lit\nboot: 0\n"
    result = tool("call", "bridge/led", '{"channel": 1, "mode": 1}')
    assert (result.code, result.out) == (1, "")
    assert result.err == "t2 call: refused: no such lamp\n"


def test_a_call_without_an_answer(tool: Tool) -> None:
    result = tool("call", "bridge/led", '{"channel": 1, "mode": 0}', "--timeout", "0.3")
    assert (result.code, result.out) == (1, "")
    assert "bridge does not answer" in result.err
    assert "no service answers" in tool("call", "mine/x", "--timeout", "0.3").err


def test_a_short_name_of_two_calls_is_ambiguous(tool: Tool) -> None:
    result = tool("call", "reset")
    assert (result.code, result.err) == (
        1, "t2 call: reset is ambiguous: safety/reset, odom/reset\n",
    )  # fmt: skip


def test_list_of_calls(tool: Tool) -> None:
    assert {line["key"] for line in tool("call").lines} == {call.path for call in keys.CALLS}
    assert "clear the named causes" in tool("call", "--text").out


@pytest.mark.parametrize("words", [("estop",), ("pub", "estop")])
def test_estop_repeats_until_safety_confirms(
    words: tuple[str, ...], buses: BusFixture, tool: Tool
) -> None:
    stopped: list[int] = []

    def latch(bus: Bus) -> None:
        bus.on_any(keys.estop_key(buses.robot), stopped.append)

    pretend(buses, "safety", {keys.SAFETY: lambda: state(*["estop"] * bool(stopped))}, latch)
    result = tool(*words)
    assert (result.code, result.err) == (0, "")
    assert f"Robot {buses.robot} is stopped." in result.out
    assert stopped


def test_an_unconfirmed_estop(
    buses: BusFixture, tool: Tool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(estop, "TIMEOUT_S", 0.3)
    pretend(buses, "safety", {keys.SAFETY: state})
    result = tool("estop")
    assert (result.code, result.out) == (1, "")
    assert f"`t2 doctor --robot {buses.robot} --set bus.connect={tool.endpoint}`" in result.err
    assert "USE THE VEHICLE'S OWN SWITCH" in result.err
