"""``t2 echo`` on a real router with simulated services."""

import json
import signal
import subprocess
import sys
from functools import partial

import msgspec
import pytest

from cli.inspect import echo
from cli.inspect.echo import clock
from cli.inspect.payload import Reading
from common import codec, keys
from common.bus.bus import Bus
from common.codec import Sample
from common.freshness import NS_PER_S
from common.messages import Bumper, Event
from tests.cli.inspect.tool import Tool, pretend
from tests.cli.processes import PATIENCE_S, t2
from tests.common.bus_fixture import BusFixture


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
    assert fields == ["pressed: true", "lost: 0", "---"]
    assert tool("echo", "bumper", "--field", "pressed", "--count", "2").out == "true\ntrue\n"
    result = tool("echo", "bumper", "--field", "presed")
    assert (result.code, result.out) == (1, "")
    assert "no field 'presed'; available: seq" in result.err


def test_invalid_messages(buses: BusFixture, tool: Tool) -> None:
    session = buses.session()
    payloads = [(b"\xc1", "zenoh/bytes"), (b"\x81\xa1a\x01", codec.encoding(Bumper))]

    def put(_: int) -> None:
        for payload, encoding in payloads:
            session.put(f"t2/v1/{buses.robot}/tel/x", payload, encoding=encoding)
        session.delete(f"t2/v1/{buses.robot}/tel/x")

    buses.loop.post(lambda: buses.loop.every(0.1, put))
    lines = tool("echo", "tel/x", "--count", "6").lines
    assert {(line["type"], json.dumps(line["message"])) for line in lines} == {
        ("bytes", '"c1"'), ("Bumper", '{"a": 1}'), ("empty", "null"),
    }  # fmt: skip
    complaints = {line["type"]: line.get("complaint", "") for line in lines}
    assert complaints["bytes"] == "not MessagePack"
    assert "pressed" in complaints["Bumper"]
    assert any(line.get("deleted") for line in lines)
    shown = tool("echo", "tel/x", "--count", "6", text=True).out
    assert "# invalid: not a Bumper" in shown
    assert "DELETE" in shown


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


def test_earlier_events_have_their_own_time(buses: BusFixture, tool: Tool) -> None:
    def publish(bus: Bus) -> None:
        bus.publisher(keys.EVENTS, service="mine").put(
            Event(name="x", level="info", text="long ago")
        )

    buses.bus(publish)
    assert tool("echo", "evt/**", "--once").lines[0]["message"]["text"] == "long ago"
    at_ns = 1_700_000_000 * NS_PER_S
    late = Sample("t2/v1/001/evt/safety", b"", "", False, None, 0, at_ns + 86_400 * NS_PER_S)
    assert clock(late, Reading("Event", {"t_ns": at_ns})).startswith("2023-11-1")
    assert clock(late, Reading("text", "")) in clock(late, Reading("Event", {"t_ns": 0}))
    assert clock(late, Reading("Event", 1, "invalid")) == clock(late, Reading("text", ""))


def test_silence(tool: Tool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(echo, "ONCE_S", 0.3)
    for words in (("tel/none", "--duration", "0.3"), ("tel/none", "--once")):
        result = tool("echo", *words)
        assert (result.code, result.out) == (1, "")
        assert f"no message on t2/v1/{tool.robot}/tel/none within 0.3 s; `t2 ls`" in result.err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_ends_it_silently(number: signal.Signals, bridge: Bus, buses: BusFixture) -> None:
    where = ("--set", f"bus.connect={buses.endpoint}", "--robot", buses.robot)
    with subprocess.Popen(
        t2("echo", "bumper", *where), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline()
        process.send_signal(number)
        _, err = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, err) == (0, "")


def test_a_closed_pipe_ends_it_silently(bridge: Bus, buses: BusFixture) -> None:
    words = f"echo bumper --json --set bus.connect={buses.endpoint} --robot {buses.robot}"
    done = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {sys.executable} -m cli {words} | head -1"],
        capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["type"] == "Bumper"
