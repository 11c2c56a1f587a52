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
IDLE = m.Cause(name="no_request", action="stop", age=1.0, text="No command to drive.", id=40)
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


def test_what_is_given_is_kept_except_the_echo(buses: BusFixture, tool: Tool) -> None:
    """Which is always the newest heartbeat."""
    place: Serve = (keys.SET_POSE, lambda _, caller: caller.reply(m.Done(text="done")))
    safety = Safety(buses, (keys.RESET, obey), place)
    for words in (("odom/reset", '{"x": 1.0}'), ("safety/reset", '{"causes": [8], "echo": 7}')):
        result = tool("call", *words)
        assert (result.code, result.err) == (0, "")
    pose, reset = safety.asked
    assert pose == m.PoseRequest(x=1.0, echo=pose.echo)
    assert reset.causes == (8,)
    assert 100 < pose.echo <= reset.echo <= safety.heartbeat


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
    result = tool("call", "led", first)
    assert (result.code, result.lines) == (0, [{"text": "lit", "phrases": [], "boot": 0}])
    assert tool("call", "/srv/bridge/led", first, text=True).out == "text: lit\nboot: 0\n"
    monkeypatch.setenv("T2_LANG", "zh")
    result = tool("call", "bridge/led", '{"channel": 1, "mode": 1}')
    assert (result.code, result.out) == (1, "")
    assert result.err == "t2 call: refused: 主控板报告失败（0xAA）。\n"


@pytest.mark.parametrize(
    ("words", "code", "phrase"),
    [
        (("safety/reset",), 1, "no state of safety within 0.3 s"),
        (("bridge/led", '{"channel": 1, "mode": 0}'), 1, "bridge does not answer"),
        (("mine/x",), 2, "no call mine/x; `t2 call` lists the calls"),
        (("/",), 2, "no call ; `t2 call` lists the calls"),
        (("reset",), 2, "reset is ambiguous: safety/reset, odom/reset"),
        (("bridge/led", '{"chanel": 1}'), 2, "not a LedRequest: no field 'chanel'"),
        (("bridge/led", '{"channel": 1}'), 2, "not a LedRequest: "),
        (("safety/reset", "{"), 2, "is not a JSON object"),
    ],
)  # fmt: skip
def test_calls_that_fail(
    words: tuple[str, ...], code: int, phrase: str, tool: Tool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "STATE_S", 0.3)
    result = tool("call", *words)
    assert (result.code, result.out) == (code, "")
    assert phrase in result.err


def test_list_of_calls(tool: Tool) -> None:
    assert {line["key"] for line in tool("call").lines} == {call.path for call in keys.CALLS}
