"""Inspection commands on a real router with simulated services."""

import json
import signal
import subprocess
import sys
import time
from functools import partial

import msgspec
import pytest
from msgspec import structs

from cli.inspect import measure
from cli.inspect.echo import clock
from cli.inspect.payload import Reading
from common import codec, keys
from common.bus.bus import Bus
from common.codec import Sample
from common.freshness import NS_PER_S
from common.messages import Bumper, Event
from common.motion import Command
from tests.cli.inspect.tool import Tool, pretend
from tests.cli.processes import PATIENCE_S, t2
from tests.common.bus_fixture import BusFixture


def bumper() -> Bumper:
    return Bumper(pressed=True)


@pytest.fixture
def bridge(buses: BusFixture) -> Bus:
    return pretend(buses, "bridge", {keys.BUMPER: bumper})


# --- echo -------------------------------------------------------------------------------------


def test_echo_as_json(bridge: Bus, tool: Tool) -> None:
    result = tool("echo", "bumper", "--once")
    (line,) = result.lines
    assert (result.code, result.err) == (0, "")
    assert (line["key"], line["type"]) == ("tel/bridge/bumper", "Bumper")
    assert (line["message"]["pressed"], line["message"]["boot"]) == (True, bridge.boot)


def test_echo_as_text(bridge: Bus, tool: Tool) -> None:
    head, *fields = tool("echo", "bumper", "--once", "--text").out.splitlines()
    assert head.startswith("# tel/bridge/bumper  Bumper  seq ")
    assert fields == ["pressed: true", "lost: 0", "---"]
    assert "boot: " in tool("echo", "bumper", "--once", "--text", "--header").out


def test_echo_as_one_line(bridge: Bus, tool: Tool) -> None:
    first, second = tool("echo", "bumper", "--count", "2", "-o", "table").out.splitlines()
    clock, key, fields = first.split(maxsplit=2)
    assert time.strptime(clock.partition(".")[0], "%H:%M:%S")
    assert (key, fields) == ("tel/bridge/bumper", '{"pressed":true,"lost":0}')
    assert second.endswith(fields)


def test_echo_of_one_message_gives_up(
    bridge: Bus, tool: Tool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cli.inspect.echo.ONCE_S", 0.3)
    result = tool("echo", "safety/state", "--once")
    assert (result.code, result.out) == (1, "")
    where = f"t2/v1/{tool.robot}/tel/safety/state"
    assert f"no message on {where} within 0.3 s; `t2 ls` lists" in result.err


def test_echo_shows_one_field(bridge: Bus, tool: Tool) -> None:
    assert tool("echo", "bumper", "--field", "pressed", "--count", "2").out == "true\ntrue\n"
    result = tool("echo", "bumper", "--field", "presed")
    assert (result.code, result.out) == (1, "")
    assert "no field 'presed'" in result.err
    assert "pressed" in result.err


def test_echo_shows_invalid_messages(buses: BusFixture, tool: Tool) -> None:
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
    shown = tool("echo", "tel/x", "--count", "6", "--text").out
    assert "# invalid: not a Bumper" in shown
    assert "DELETE" in shown


def test_echo_escapes_control_characters(buses: BusFixture, tool: Tool) -> None:
    hostile = "\x1b]0;title\x07\x1b[2J\x9b31m\u202e"
    payload = msgspec.msgpack.encode({f"a{hostile}": {f"b{hostile}": hostile}})
    put = partial(buses.session().put, f"t2/v1/{buses.robot}/tel/x{hostile[:4]}", payload)
    buses.loop.post(lambda: buses.loop.every(0.1, lambda _: put()))
    for form in ("--text", "--json", "-otable"):
        shown = tool("echo", "tel/*", "--once", form).out
        assert shown.replace("\n", "").isprintable(), shown
        assert "\\u001b[2J\\u0" in shown
    (line,) = tool("echo", "tel/*", "--once").lines
    assert line["message"] == {f"a{hostile}": {f"b{hostile}": hostile}}


def test_echo_shows_earlier_events(buses: BusFixture, tool: Tool) -> None:
    def publish(bus: Bus) -> None:
        bus.publisher(keys.EVENTS, service="mine").put(
            Event(name="x", level="info", text="long ago")
        )

    buses.bus(publish)
    assert tool("echo", "evt/**", "--once").lines[0]["message"]["text"] == "long ago"


def test_echo_shows_the_time_of_an_event_itself() -> None:
    at_ns = 1_700_000_000 * NS_PER_S
    late = Sample("t2/v1/001/evt/safety", b"", "", False, None, 0, at_ns + 30 * NS_PER_S)
    stored = structs.replace(late, wall_ns=at_ns)
    assert clock(late, Reading("Event", {"t_ns": at_ns})) == clock(stored, Reading("text", ""))
    next_day = structs.replace(late, wall_ns=at_ns + 86_400 * NS_PER_S)
    assert clock(next_day, Reading("Event", {"t_ns": at_ns})).startswith("2023-11-1")
    assert not clock(next_day, Reading("Event", {"t_ns": 0})).startswith("2023")


def test_echo_reports_silence(tool: Tool) -> None:
    result = tool("echo", "tel/none", "--duration", "0.2")
    assert (result.code, result.out) == (1, "")
    assert "no message on t2/v1/" in result.err


# --- hz, delay, bw, ls ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("word", "fields"),
    [
        ("hz", {"hz", "min", "max", "std_dev", "lost", "window"}),
        ("delay", {"mean", "min", "p50", "p99", "max", "clock", "window"}),
        ("bw", {"bytes_per_s", "mean", "min", "max", "window"}),
    ],
)
def test_measured_fields(word: str, fields: set[str], bridge: Bus, tool: Tool) -> None:
    result = tool(word, "tel/**", "--count", "20")
    assert (result.code, result.err) == (0, "")
    line = result.lines[-1]
    assert line.keys() == fields | {"key"}
    assert line["key"] == "tel/bridge/bumper"
    assert all(line[name] is not None for name in fields)


def test_the_delay_is_by_the_host_s_own_clock_where_it_is_shared(bridge: Bus, tool: Tool) -> None:
    line = tool("delay", "bumper", "--count", "5").lines[-1]
    assert line["clock"] == ("host" if bridge.host else "wall")
    assert 0 < line["min"] < 5


def test_silence_is_reported_once_a_second(tool: Tool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measure, "REPORT_S", 0.05)
    result = tool("hz", "tel/none", "--duration", "0.3")
    assert (result.code, result.out) == (1, "")
    assert "t2 hz: no new messages" in result.err
    assert "no message on" in result.err


def test_ls_names_type_rate_and_publisher(buses: BusFixture, bridge: Bus, tool: Tool) -> None:
    buses.bus(lambda bus: bus.publisher(keys.VELOCITY))  # declared, silent, by a stranger
    stranger = buses.session()
    buses.loop.post(
        lambda: buses.loop.every(0.1, lambda _: stranger.put(f"t2/v1/{buses.robot}/tel/x", b"\x01"))
    )
    found = {line["key"]: line for line in tool("ls", "--duration", "1").lines}
    assert found.keys() == {"tel/bridge/bumper", "tel/bridge/velocity", "tel/x"}
    row = found["tel/bridge/bumper"]
    assert (row["type"], row["expected_hz"]) == ("Bumper", 50)
    assert row["publishers"] == ["bridge"]
    assert row["hz"] > 1
    assert (found["tel/bridge/velocity"]["hz"], found["tel/x"]["expected_hz"]) == (None, None)
    shown = tool("ls", "bumper", "--duration", "0.5", "--text").out.splitlines()
    assert shown[0].split() == ["key", "type", "Hz", "of", "publisher"]
    assert shown[1].split()[::4] == ["tel/bridge/bumper", "bridge"]
    every = tool("ls", "bumper", "--duration", "0.5", robot="*").lines
    assert keys.BUMPER.on(buses.robot) in {line["key"] for line in every}


def test_ls_without_keys(tool: Tool) -> None:
    result = tool("ls", "--duration", "0.2")
    assert (result.code, result.out) == (1, "")
    assert "t2 doctor" in result.err


# --- services, schema -------------------------------------------------------------------------


def test_services(buses: BusFixture, bridge: Bus, tool: Tool) -> None:
    pretend(buses, "safety", {}, lambda bus: bus.subscribe(keys.BUMPER, lambda _: None))
    pretend(buses, "nav", {keys.MOTION: lambda: keys.MOTION.message(command=Command.STOP)})
    found = {line["name"]: line for line in tool("services").lines}
    assert found.keys() >= {"bridge", "safety", "nav"}
    assert found["bridge"]["publishes"]["tel/bridge/bumper"] == ["safety"]
    assert found["safety"]["reads"] == ["tel/bridge/bumper"]
    assert "@cmd/motion" in found["nav"]["publishes"]
    assert '"bridge" -> "safety" [label="tel/bridge/bumper"];' in tool("services", "--dot").out
    shown = tool("services", "--text").out
    assert "publishes  tel/bridge/bumper            -> safety" in shown
    assert "publishes  @cmd/motion                  -> no reader" in shown


def test_no_services(tool: Tool) -> None:
    result = tool("services")
    assert (result.code, result.out) == (1, "")
    assert "no service found" in result.err


def test_schema_by_type_and_by_key(tool: Tool) -> None:
    (by_type,) = tool("schema", "odometry").lines
    assert tool("schema", "tel/odom/odometry").lines == [by_type]
    assert by_type["$ref"].endswith("Odometry")
    shown = tool("schema", "Odometry", "--text").out
    assert shown.startswith("Odometry: Pose in")
    assert "rad, wrapped to -pi..pi" in shown
    assert tool("schema", "safety/reset").lines[0]["$ref"].endswith("ResetRequest")
    assert "Odometry" in {line["type"] for line in tool("schema").lines}


def test_an_unknown_type(tool: Tool) -> None:
    result = tool("schema", "Odomtry")
    assert (result.code, result.out) == (1, "")
    assert "did you mean Odometry?" in result.err


# --- how they end -----------------------------------------------------------------------------


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
    words = f"echo bumper -o json --set bus.connect={buses.endpoint} --robot {buses.robot}"
    done = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {sys.executable} -m cli {words} | head -1"],
        capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["type"] == "Bumper"
