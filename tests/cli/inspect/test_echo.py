"""``t2 echo`` on a real router with simulated services."""

import json
import subprocess
import sys
from functools import partial
from pathlib import Path

import msgspec
import pytest

from cli.inspect import echo
from common.bus.bus import Bus
from t2 import codec, keys
from t2.messages import Bumper, Event, Phrase
from tests.cli.inspect.tool import Tool, pretend
from tests.cli.processes import PATIENCE_S, running, sets, t2
from tests.common.bus_fixture import BusFixture
from verification.harness.waiting import wait_until


@pytest.fixture
def bridge(buses: BusFixture) -> Bus:
    return pretend(buses, "bridge", {keys.BUMPER: lambda: Bumper(pressed=True)})


def test_a_message_and_one_field(bridge: Bus, tool: Tool) -> None:
    result = tool("echo", "bumper", "--once")
    (line,) = result.lines
    assert (result.code, result.err) == (0, "")
    assert (line["key"], line["type"]) == ("tel/bridge/bumper", "Bumper")
    assert (line["message"]["pressed"], line["message"]["boot"]) == (True, bridge.boot)
    head, *fields = tool("echo", "bumper", "--once", text=True).out.splitlines()
    assert head.startswith("# tel/bridge/bumper  Bumper  seq ")
    assert fields == ["pressed: true", "---"]
    assert tool("echo", "bumper", "--field", "pressed", "--once").out == "true\n"
    result = tool("echo", "bumper", "--field", "presed")
    assert (result.code, result.out) == (1, "")
    assert "no field 'presed'; available: seq" in result.err


def test_invalid_messages(buses: BusFixture, tool: Tool) -> None:
    session, key = buses.session(), f"t2/v1/{buses.robot}/tel/x"

    def put(_: int) -> None:
        session.put(key, b"\x81\xa1a\x01", encoding=codec.encoding(Bumper))
        session.delete(key)

    buses.loop.post(lambda: buses.loop.every(0.1, put))
    lines = tool("echo", "tel/x", "--duration", "0.5").lines
    found = {line["type"]: (line["message"], line.get("complaint", "")) for line in lines}
    value, complaint = found.pop("Bumper")
    assert (value, found) == ({"a": 1}, {"empty": (None, "")})
    assert "pressed" in complaint
    shown = tool("echo", "tel/x", "--duration", "0.5", text=True).out
    assert "# invalid: not a Bumper" in shown


def test_control_characters_are_escaped(buses: BusFixture, tool: Tool) -> None:
    hostile = "\x1b]0;title\x07\x1b[2J\x9b31m\u202e"
    payload = msgspec.msgpack.encode({f"a{hostile}": {f"b{hostile}": hostile}})
    put = partial(buses.session().put, f"t2/v1/{buses.robot}/tel/x{hostile[:4]}", payload)
    buses.loop.post(lambda: buses.loop.every(0.1, lambda _: put()))
    for text in (True, False):
        shown = tool("echo", "tel/*", "--once", text=text).out
        assert shown.replace("\n", "").isprintable(), shown
        assert "\\u001b[2J\\u0" in shown
    assert json.loads(shown)["message"] == {f"a{hostile}": {f"b{hostile}": hostile}}


def test_earlier_events_are_shown_in_the_readers_language(
    buses: BusFixture, tool: Tool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def publish(bus: Bus) -> None:
        bus.publisher(keys.EVENTS, service="mine").put(
            Event(name="stop", level="info", text="Bumper.", phrases=(Phrase("contact"),))
        )

    buses.bus(publish)
    assert tool("echo", "evt/**", "--once").lines[0]["message"]["text"] == "Bumper."
    monkeypatch.setenv("T2_LANG", "zh")
    shown = tool("echo", "evt/**", "--once", text=True).out
    assert "text: 防撞条已触发。\n" in shown
    assert "phrases" not in shown


def test_silence(tool: Tool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(echo, "ONCE_S", 0.3)
    for words in (("tel/none", "--duration", "0.3"), ("tel/none", "--once")):
        result = tool("echo", *words)
        assert (result.code, result.out) == (1, "")
        assert f"no message on t2/v1/{tool.robot}/tel/none within 0.3 s; `t2 ls --set" in result.err


def test_a_termination_ends_it_silently(bridge: Bus, buses: BusFixture, tmp_path: Path) -> None:
    where = [*sets(f"bus.connect={buses.endpoint}"), "--robot", buses.robot]
    with running(t2("echo", "bumper", "--json", *where), tmp_path / "log") as process:
        wait_until((tmp_path / "log").read_text, "a message", PATIENCE_S)
        process.terminate()
        assert process.wait(PATIENCE_S) == 0
    assert all(map(json.loads, (tmp_path / "log").read_text().splitlines()))


def test_a_closed_pipe_ends_it_silently(bridge: Bus, buses: BusFixture) -> None:
    words = f"echo bumper --json --set bus.connect={buses.endpoint} --robot {buses.robot}"
    done = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {sys.executable} -m cli {words} | head -1"],
        capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["type"] == "Bumper"
