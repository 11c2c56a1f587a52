"""``t2 call``: replies, refusals, an operator's defaults from safety's state, confirmation."""

from collections.abc import Callable
from functools import partial
from typing import Any

import msgspec
import pytest
import zenoh

from cli.inspect import client
from common.bus.bus import Bus, Caller
from t2 import codec, keys
from t2 import messages as m
from tests.cli.inspect.tool import FakeSafety, Tool, pretend
from tests.common.bus_fixture import BusFixture

CONTACT = m.Cause(name="contact", action="brake", age=1.0, text="The bumper was hit.", id=41)
IDLE = m.Cause(name="no_request", action="stop", age=1.0, text="No source requests motion.", id=40)
CLEARS = "t2 call: asks to clear contact: The bumper was hit.\n"
Serve = tuple[keys.Call[Any, Any], Callable[..., None]]
NOT_CONFIRMED = "not confirmed: safety's state does not show this reset"


class Safety(FakeSafety):
    """A safety service with a latched contact, which serves calls as configured."""

    def __init__(self, buses: BusFixture, *serves: Serve) -> None:
        self.asked: list[Any] = []
        self._serves = serves
        contact: dict[str, Any] = {
            "verdict": "brake",
            "latched": ("contact",),
            "causes": (CONTACT, IDLE),
        }
        super().__init__(buses, self.serve, **contact)

    def serve(self, bus: Bus) -> None:
        for call, answer in self._serves:
            bus.serve(call, partial(self.take, answer))

    def take(self, answer: Callable[..., None], request: msgspec.Struct, caller: Any) -> None:
        self.asked.append(request)
        answer(self, caller)


def obey(safety: Safety, caller: Caller[m.ResetDone]) -> None:
    """Clear the causes, and answer with them."""
    safety.fields = {"causes": (IDLE,)}
    done = m.ResetDone(
        text="Reset.", boot=safety.bus.boot, heartbeat=safety.heartbeat + 1, cleared=(41,)
    )
    caller.reply(done)


def test_a_reset_names_the_latched_causes_and_is_confirmed_by_the_state(
    buses: BusFixture, tool: Tool
) -> None:
    safety = Safety(buses, (keys.RESET, obey))
    result = tool("call", "safety/reset", text=True)
    assert (result.code, result.err) == (0, CLEARS)
    assert "text: Reset." in result.out
    (request,) = safety.asked
    assert isinstance(request, m.ResetRequest)
    assert request.causes == (41,)
    assert request.echo is not None
    assert 100 < request.echo <= safety.heartbeat


@pytest.mark.parametrize("payload", [b"ok", codec.encode(m.ResetDone(text="ok"))])
def test_a_rogue_answer_is_not_confirmed(payload: bytes, buses: BusFixture, tool: Tool) -> None:
    Safety(buses)
    key = keys.RESET.on(buses.robot)

    def answer(query: zenoh.Query) -> None:
        query.reply(key, payload)
        query.drop()

    queryable = buses.session().declare_queryable(key, answer)
    result = tool("call", "safety/reset")
    assert result.code == 1
    assert NOT_CONFIRMED in result.err
    queryable.undeclare()


@pytest.mark.parametrize(
    ("words", "call", "meant"),
    [
        (("odom/reset", '{"x": 1.0}'), keys.SET_POSE, m.PoseRequest(x=1.0)),
        (("bridge/switches",), keys.SET_SWITCHES, m.SwitchesRequest()),
    ],
)
def test_every_operator_call_echoes_the_newest_state(
    words: tuple[str, ...], call: keys.Call[Any, Any], meant: Any, buses: BusFixture, tool: Tool
) -> None:
    reply = m.Switches() if call is keys.SET_SWITCHES else m.Done(text="done")
    safety = Safety(buses, (call, lambda _, caller: caller.reply(reply)))
    result = tool("call", *words)
    assert (result.code, result.err) == (0, "")
    (asked,) = safety.asked
    assert 100 < asked.echo <= safety.heartbeat
    assert asked == msgspec.structs.replace(meant, echo=asked.echo)


def test_given_causes_are_kept(buses: BusFixture, tool: Tool) -> None:
    safety = Safety(buses, (keys.RESET, obey))
    assert tool("call", "safety/reset", '{"causes": [8], "echo": 7}').err == ""
    assert safety.asked[0].causes == (8,)
    assert safety.asked[0].echo > 7  # always the newest heartbeat


def test_no_operators_call_without_a_state(
    buses: BusFixture, tool: Tool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "STATE_S", 0.3)
    result = tool("call", "safety/reset")
    assert (result.code, result.out) == (1, "")
    assert "no state of safety within 0.3 s" in result.err


def test_replies_and_refusals(
    buses: BusFixture, tool: Tool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def led(request: m.LedRequest, caller: Caller[m.Done]) -> None:
        if request.channel:
            caller.refuse(m.Phrase("board.failure"))
        else:
            caller.reply(m.Done(text="lit"))

    pretend(buses, "bridge", {}, lambda bus: bus.serve(keys.SET_LED, led))
    first = '{"channel": 0, "mode": 1}'
    for key in ("led", "bridge/led", "/srv/bridge/led"):
        result = tool("call", key, first)
        assert (result.code, result.lines) == (0, [{"text": "lit", "phrases": [], "boot": 0}])
    assert tool("call", "bridge/led", first, text=True).out == "text: lit\nboot: 0\n"
    result = tool("call", "bridge/led", '{"channel": 1, "mode": 1}')
    assert (result.code, result.out) == (1, "")
    assert result.err == "t2 call: refused: The board reports a failure (0xAA).\n"
    monkeypatch.setenv("T2_LANG", "zh")
    result = tool("call", "bridge/led", '{"channel": 1, "mode": 1}')
    assert result.err == "t2 call: refused: 主控板报告失败（0xAA）。\n"


@pytest.mark.parametrize(
    ("words", "code", "phrase"),
    [
        (("bridge/led", '{"channel": 1, "mode": 0}'), 1,
         "bridge does not answer"),
        (("mine/x",), 2, "no call mine/x; `t2 call` lists the calls"),
        (("reset",), 2, "reset is ambiguous: safety/reset, odom/reset"),
        (("bridge/led", '{"chanel": 1}'), 2, "not a LedRequest: no field 'chanel'"),
        (("bridge/led", '{"channel": 1}'), 2, "not a LedRequest: "),
        (("odom/reset", '{"X": 1.0}'), 2, "not a PoseRequest: no field 'X'"),
        (("/",), 2, "no call ; `t2 call` lists the calls"),
        (("safety/reset", "{"), 2, "is not a JSON object"),
        (("safety/*",), 2, "no call safety/*"),
    ],
)  # fmt: skip
def test_calls_that_fail(words: tuple[str, ...], code: int, phrase: str, tool: Tool) -> None:
    result = tool("call", *words)
    assert (result.code, result.out) == (code, "")
    assert phrase in result.err


def test_list_of_calls(tool: Tool) -> None:
    assert {line["key"] for line in tool("call").lines} == {call.path for call in keys.CALLS}
    assert "clear the named causes" in tool("call", text=True).out
