"""``t2 doctor`` on a real router with simulated services, and without one.

On the real stack: ``tests/cli/test_on_stack.py``.
"""

import signal
import socket
from functools import partial
from pathlib import Path
from unittest.mock import Mock

import pytest
from msgspec.structs import replace

from cli.inspect import doctor
from cli.inspect.diagnosis import diagnose
from cli.inspect.doctor import connect, findings
from cli.inspect.findings import REMEDIES
from common.bus.bus import Bus
from common.bus.inspector import inspecting
from common.settings import Shared
from t2 import keys
from t2.messages import Bumper
from tests.cli.inspect.tool import Tool, pretend
from tests.common.bus_fixture import BusFixture
from tests.factories import health, map_pose, safety_state
from verification.harness.bus import at, router_process
from verification.harness.certificates import Site, connecting
from verification.harness.ports import free_port


def test_what_it_observes(buses: BusFixture, tool: Tool) -> None:
    def safety(bus: Bus) -> None:
        bus.on_any(keys.DRIVE.on(bus.robot, source="teleop"), lambda _: None)
        bus.serve(keys.RESET, lambda _, __: None)

    streams = {keys.BUMPER: lambda: Bumper(pressed=True)}
    pretend(buses, "bridge", {**streams, keys.HEALTH: partial(health, "bridge")}, service="bridge")
    pretend(buses, "safety", {keys.SAFETY: partial(safety_state, heartbeat=1)}, safety)
    pretend(buses, "localization", {keys.MAP_POSE: map_pose}, service="localization")
    session, key = buses.session(), keys.LINK.on(buses.robot)
    buses.loop.post(lambda: buses.loop.every(0.1, lambda _: session.put(key, b"\xc1")))
    result = tool("doctor", "--duration", "1")
    assert (result.code, result.err) == (1, "")
    found = [(each["where"], each["level"], each["text"]) for each in result.lines]
    assert ("rights", "ok", "this laptop may read; drive as teleop; call safety/reset") in found
    assert ("services", "wrong", "odom is not running") in found
    assert not any(level == "wrong" and "odom/odometry" in text for _, level, text in found)
    assert any(text.startswith("safety is running and publishes no") for *_, text in found)
    assert any(text.startswith("tel/bridge/link: ") for *_, text in found)
    assert ("map", "ok", map_pose().text) in found
    assert any(where == "clock" and level == "ok" for where, level, _ in found)


def test_no_router_in_the_readers_language(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("T2_LANG", "zh")
    result = Tool(f"tcp/127.0.0.1:{free_port()}", "001", capsys)("doctor", text=True)
    assert (result.code, result.err) == (1, "")
    first, todo, *_, last = result.out.splitlines()
    assert first.startswith("网络      错误   tcp/127.0.0.1:")
    assert first.endswith("连接被拒绝：主机在线，但没有程序监听")
    assert todo.strip() == f"-> {REMEDIES['refused'][1]}"
    assert last == "发现 1 个问题。"


def test_one_reachable_endpoint_is_enough_and_a_slow_router_hides_its_services() -> None:
    reached, absent = (f"tcp/127.0.0.1:{free_port()}" for _ in range(2))
    where = at(absent, reached)
    with router_process(reached) as router, inspecting(where) as opened:
        first, second, *rest = findings(Shared(bus=where), 0.1)
        router.send_signal(signal.SIGSTOP)
        seen = doctor.observe(opened, where, "001", 0.1)
    assert (first.level, first.todo()) == ("note", REMEDIES["refused"][0])
    assert (second.where, second.level) == ("network", "ok")
    assert [each.todo() for each in rest if each.level == "wrong"] == [REMEDIES["start"][0]]
    assert not seen.listed
    assert "wrong" not in {each.level for each in diagnose(seen, "001")}


def test_an_endpoint_that_is_not_a_router(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        result = Tool(f"tcp/127.0.0.1:{port}", "001", capsys)("doctor")
    assert [each["where"] for each in result.lines if each["level"] == "wrong"] == ["router"]


def test_endpoints_of_every_kind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert connect("udp/127.0.0.1:7447", at()).level == "unknown"
    assert connect(f"unixsock-stream/{tmp_path}/no.sock", at()).level == "wrong"
    assert connect(f"unixsock-stream/{tmp_path}", at()).level == "ok"
    for error, text in (
        (socket.gaierror(), "unknown host name robot"),
        (TimeoutError(), "no answer"),
        (OSError(101, "Network is unreachable"), "network is unreachable"),
    ):
        monkeypatch.setattr(socket, "create_connection", Mock(side_effect=error))
        found = connect("tcp/robot:7447", at())
        assert (found.level, found.text()) == ("wrong", f"tcp/robot:7447: {text}")


def test_certificates(tmp_path: Path) -> None:
    site = Site(tmp_path / "ours")
    robot = site.member("robot", "001", "--address", "127.0.0.1")
    anna = site.member("driver", "anna", "--robot", "001")
    stranger = Site(tmp_path / "theirs").member("driver", "mallory", "--robot", "001")
    with site.router(robot) as (endpoint, _):
        bob = site.member("driver", "bob", "--robot", "001")  # unknown to the running router
        for member, text, remedy in (
            (anna, "safety, bridge, odom are not running", "start"),
            (bob, "this router does not know driver.bob.", "stranger"),
            (stranger, "the router's certificate is not trusted: ", "certificate"),
            (replace(stranger, ca=anna.ca), "the router refuses this certificate: ", "certificate"),
            (replace(anna, private_key=str(tmp_path / "no.key")),
             "bus.private_key is invalid: No such file or directory", "certificate"),
        ):  # fmt: skip
            found = findings(Shared(bus=connecting(member, endpoint)), 0.2)
            (wrong,) = (each for each in found if each.level == "wrong")
            assert (text in wrong.text(), wrong.todo()) == (True, REMEDIES[remedy][0]), wrong
