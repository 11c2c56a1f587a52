"""``t2 doctor`` on a real router with simulated services, and without one.

On the real stack: ``tests/cli/test_on_stack.py``.
"""

import json
import signal
import socket
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import msgspec
import pytest

from cli.__main__ import main
from cli.inspect import doctor
from cli.inspect.diagnosis import diagnose
from cli.inspect.doctor import connect, findings
from cli.inspect.findings import REMEDIES, Finding
from common.bus.bus import Bus
from common.bus.probe import probe
from common.settings import BusSettings, Shared
from t2 import keys
from t2.messages import Bumper
from tests.cli.inspect.tool import Result, Tool, pretend
from tests.common.bus_fixture import BusFixture
from tests.factories import health, safety_state
from verification.harness.bus import at, router_process
from verification.harness.certificates import Site, connecting
from verification.harness.ports import free_port


def wrong(result: Result) -> list[tuple[str, str]]:
    """Return places and remedies of the problems."""
    return [(each["where"], each["todo"]) for each in result.lines if each["level"] == "wrong"]


def test_what_it_observes(buses: BusFixture, tool: Tool) -> None:
    def safety(bus: Bus) -> None:
        bus.on_any(keys.DRIVE.on(bus.robot, source="teleop"), lambda _: None)
        bus.serve(keys.RESET, lambda _, __: None)

    streams = {keys.BUMPER: lambda: Bumper(pressed=True)}
    pretend(buses, "bridge", {**streams, keys.HEALTH: partial(health, "bridge")}, service="bridge")
    pretend(buses, "safety", {keys.SAFETY: partial(safety_state, heartbeat=1)}, safety)
    session, key = buses.session(), keys.LINK.on(buses.robot)
    buses.loop.post(lambda: buses.loop.every(0.1, lambda _: session.put(key, b"\xc1")))
    result = tool("doctor", "--duration", "1")
    assert (result.code, result.err) == (1, "")
    found = [(each["where"], each["level"], each["text"]) for each in result.lines]
    assert ("rights", "ok", "this laptop may read; drive as teleop; call safety/reset") in found
    assert ("services", "ok", "bridge is up for 60 s") in found
    assert ("services", "wrong", "odom is not running") in found
    assert not any(level == "wrong" and "odom/odometry" in text for _, level, text in found)
    assert any(text.startswith("safety is running and publishes no") for *_, text in found)
    assert any(text.startswith("tel/bridge/link: ") for *_, text in found)
    assert any(where == "clock" and level == "ok" for where, level, _ in found)


def test_no_router_in_each_language(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    result = Tool(f"tcp/127.0.0.1:{free_port()}", "001", capsys)("doctor", text=True)
    assert (result.code, result.err) == (1, "")
    lines = result.out.splitlines()
    assert "WRONG" in lines[0]
    assert "connection refused" in lines[0]
    assert lines[1].strip() == f"-> {REMEDIES['refused'][0]}"
    assert lines[-1] == "1 problem found."
    monkeypatch.setenv("T2_LANG", "zh")
    lines = Tool(f"tcp/127.0.0.1:{free_port()}", "001", capsys)(
        "doctor", text=True
    ).out.splitlines()
    assert lines[0].startswith("网络      错误   tcp/127.0.0.1:")
    assert lines[0].endswith("连接被拒绝：主机在线，但没有程序监听")
    assert lines[1].strip() == f"-> {REMEDIES['refused'][1]}"
    assert lines[-1] == "发现 1 个问题。"
    monkeypatch.setenv("T2_LANG", "fr")
    result = Tool(f"tcp/127.0.0.1:{free_port()}", "001", capsys)("doctor")
    assert (result.code, result.out) == (78, "")
    assert "environment T2_LANG: 'fr' is unknown; use en or zh" in result.err


def test_one_reachable_endpoint_is_enough_and_services_may_be_missing() -> None:
    reached, absent = (f"tcp/127.0.0.1:{free_port()}" for _ in range(2))
    with router_process(reached):
        config = Shared(bus=BusSettings(connect=(absent, reached)))
        first, second, *rest = findings(config, 0.1)
    assert (first.level, first.todo()) == ("note", REMEDIES["refused"][0])
    assert (second.where, second.level) == ("network", "ok")
    assert [each.todo() for each in rest if each.level == "wrong"] == [REMEDIES["start"][0]]


def test_services_that_a_slow_router_does_not_list_are_not_missing() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    where = at(endpoint)
    with router_process(endpoint) as router, probe(where) as opened:
        router.send_signal(signal.SIGSTOP)
        seen = doctor.observe(opened, where, "001", 0.1)
    assert not seen.listed
    assert "wrong" not in {each.level for each in diagnose(seen, "001")}


def test_an_endpoint_that_is_not_a_router(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        result = Tool(f"tcp/127.0.0.1:{port}", "001", capsys)("doctor")
    assert [where for where, _ in wrong(result)] == ["router"]


def test_endpoints_of_every_kind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert connect("udp/127.0.0.1:7447", at()).level == "unknown"
    assert connect(f"unixsock-stream/{tmp_path}/no.sock", at()).level == "wrong"
    assert connect(f"unixsock-stream/{tmp_path}", at()).level == "ok"
    for error, text in (
        (socket.gaierror(), "unknown host name robot"),
        (TimeoutError(), "no answer"),
        (OSError(101, "Network is unreachable"), "network is unreachable"),
    ):

        def fail(*_: object, error: OSError = error) -> None:
            raise error

        monkeypatch.setattr(socket, "create_connection", fail)
        found = connect("tcp/robot:7447", at())
        assert (found.level, found.text()) == ("wrong", f"tcp/robot:7447: {text}")


# --- certificates ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def driver_at(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[BusSettings, str]]:
    """Return a driver's settings, and the endpoint of the robot's router."""
    site = Site(tmp_path_factory.mktemp("ours") / "keys")
    driver = site.member("driver", "anna", "--robot", "001")
    with site.router(site.member("robot", "001", "--address", "127.0.0.1")) as (endpoint, _):
        yield driver, endpoint


def first(member: BusSettings, endpoint: str) -> Finding:
    """Return the finding of the network."""
    return next(findings(Shared(bus=connecting(member, endpoint)), 0.1))


def test_an_unknown_certificate_and_hints_with_the_options(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    site = Site(tmp_path / "keys")
    robot = site.member("robot", "001", "--address", "127.0.0.1")
    site.member("driver", "anna", "--robot", "001")
    with site.router(robot) as (endpoint, _):
        site.member("driver", "bob", "--robot", "001")  # unknown to the running router

        def found(name: str) -> list[tuple[str, str]]:
            file = site.folder / f"driver.{name}" / "bus.toml"
            words = ["--config", str(file), "--set", f"bus.connect={endpoint}"]
            main(["doctor", "--json", "--duration", "0.2", *words])
            lines = map(json.loads, capsys.readouterr().out.splitlines())
            return [(line["text"], line["todo"]) for line in lines if line["level"] == "wrong"]

        capsys.readouterr()
        ((text, todo),) = found("bob")
        assert text.startswith("this router does not know driver.bob.")
        assert todo == REMEDIES["stranger"][0]
        assert found("anna") == [("safety, bridge, odom are not running", REMEDIES["start"][0])]


def test_certificates(driver_at: tuple[BusSettings, str], tmp_path: Path) -> None:
    driver, endpoint = driver_at
    assert first(driver, endpoint).level == "ok"
    stranger = Site(tmp_path / "keys").member("driver", "mallory", "--robot", "001")
    missing = msgspec.structs.replace(driver, private_key=str(tmp_path / "no.key"))
    mixed = msgspec.structs.replace(stranger, ca=driver.ca)
    for member, problem in (
        (stranger, "the router's certificate is not trusted: "),
        (mixed, "the router refuses this certificate: "),
        (missing, "bus.private_key is invalid: No such file or directory"),
    ):
        found = first(member, endpoint)
        assert (found.where, found.level) == ("network", "wrong")
        assert found.todo() == REMEDIES["certificate"][0]
        assert problem in found.text()
