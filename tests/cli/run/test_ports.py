"""Ports of ``t2 up``, and the check that they are free."""

import contextlib
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from cli.run import ports
from cli.run.ports import Port, claimed, wanted
from cli.settings import Everything
from common.bus.session import router
from common.settings import BusSettings
from t2.errors import LinkError
from verification.harness.bus import listening

TYPES = {"tcp": socket.SOCK_STREAM, "udp": socket.SOCK_DGRAM}


@contextlib.contextmanager
def held(kind: socket.SocketKind) -> Iterator[int]:
    """Hold a port of this host."""
    with socket.socket(socket.AF_INET, kind) as sock:
        sock.bind(("127.0.0.1", 0))
        if kind == socket.SOCK_STREAM:
            sock.listen()
        yield sock.getsockname()[1]


def test_ports_by_process() -> None:
    listen = ("tcp/127.0.0.1:7447", "tls/[::1]:7448#iface=lo", "quic/localhost:9?a=b",
              "unixsock-stream//run/t2/bus.sock")  # fmt: skip
    bus = BusSettings(listen=listen, ca="a", certificate="b", private_key="c", members="d")
    config = Everything(bus=bus)
    assert [port[:3] for port in wanted(config, ["router"])] == [
        ("tcp", "127.0.0.1", 7447),
        ("tcp", "::1", 7448),
        ("udp", "localhost", 9),
        ("unix", "/run/t2/bus.sock", 0),
    ]
    assert [port[2] for port in wanted(config, ["bridge", "safety"])] == [4002, 4001]
    assert [port[2] for port in wanted(config, ["sim"])] == [4003]


@pytest.mark.parametrize(
    ("kind", "setting"), [("tcp", "bus.listen"), ("udp", "board.listen_ports")]
)
def test_a_taken_port_is_named_with_advice(kind: str, setting: str) -> None:
    with held(TYPES[kind]) as number:
        port = Port(kind, "127.0.0.1", number, setting)
        with pytest.raises(LinkError) as raised:
            claimed([port], 0.0)
    message = str(raised.value)
    assert f"127.0.0.1:{number} ({port.setting}): used by another program" in message
    assert "is a stack already running?" in message
    unix = Port("unix", "/run/t2/bus.sock", 0, "bus.listen")
    for each in (port, unix):  # of two concurrent starts one continues
        with claimed([each], 0.0), pytest.raises(LinkError, match="used by another program"):
            claimed([each], 0.0)


def test_an_address_of_another_computer_is_no_taken_port() -> None:
    port = Port("udp", "192.0.2.1", 4002, "board.listen_ports")
    with pytest.raises(LinkError, match=r"`ip -brief address` .* correct board.listen_address"):
        claimed([port])  # without waiting for anything


def test_ports_of_a_killed_stack_are_awaited() -> None:
    with contextlib.ExitStack() as leaving:
        number = leaving.enter_context(held(socket.SOCK_DGRAM))
        threading.Timer(3 * ports.LOOK_S, leaving.close).start()
        began_s = time.monotonic()
        claimed([Port("udp", "127.0.0.1", number, "board.port")]).close()
        assert time.monotonic() - began_s >= 2 * ports.LOOK_S


def test_only_a_live_unix_socket_is_taken(tmp_path: Path) -> None:
    path = str(tmp_path / "bus.sock")
    port = Port("unix", path, 0, "bus.listen")
    with (
        router(listening(f"unixsock-stream/{path}")),
        pytest.raises(LinkError, match="used by another"),
    ):
        claimed([port], 0.0)
    with socket.socket(socket.AF_UNIX) as stale:
        stale.bind(f"{path}.2")
    with claimed([port._replace(host=f"{path}.2"), port._replace(host=f"{path}.3")], 0.0):
        pass
