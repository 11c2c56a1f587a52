"""The other buses: what each takes to run, and its module by name."""

import contextlib
import socket
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Protocol, cast

from bench.path.processes import answers, given, module, running
from bench.path.twist import Say
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until


class Carrier(Protocol):
    """A module ``by_NAME``: ``where`` says the same to both ends."""

    def sender(self, where: str) -> Say:
        """Return what sends."""

    def listen(self, where: str, take: Say) -> None:
        """Take what comes, until killed."""


def carrier(name: str) -> Carrier:
    """Import one."""
    return cast(Carrier, import_module(f"bench.path.by_{name}"))


@dataclass(frozen=True, slots=True)
class Other:
    """A bus of somebody else; it stands while its context lasts, which tells where."""

    title: str
    name: str
    stand: Callable[[], AbstractContextManager[str]]
    package: str = ""  # that it wants, by its name in requirements-bench.lock
    program: str = ""


@contextlib.contextmanager
def udp() -> Iterator[str]:
    """Tell a port."""
    yield str(free_port(socket.SOCK_DGRAM))


@contextlib.contextmanager
def zmq() -> Iterator[str]:
    """Tell an address in a folder of its own."""
    with tempfile.TemporaryDirectory() as folder:
        yield f"ipc://{folder}/bus"


@contextlib.contextmanager
def dds() -> Iterator[str]:
    """Tell a domain that nobody else has."""
    yield str(1 + free_port() % 200)


@contextlib.contextmanager
def lcm() -> Iterator[str]:
    """Tell where packets stay on this host."""
    yield f"udpm://239.255.76.67:{free_port(socket.SOCK_DGRAM)}?ttl=0"


@contextlib.contextmanager
def mqtt() -> Iterator[str]:
    """Run a broker on loopback."""
    broker = free_port()
    with running(["mosquitto", "-p", str(broker)]):
        wait_until(lambda: answers(broker), "mosquitto")
        yield str(broker)


@contextlib.contextmanager
def redis() -> Iterator[str]:
    """Run a server that writes nothing down."""
    with tempfile.TemporaryDirectory() as folder:
        path = f"{folder}/redis.sock"
        server = ["redis-server", "--port", "0", "--unixsocket", path, "--save", ""]
        with running([*server, "--dir", folder]):
            wait_until(Path(path).exists, "redis-server")
            yield path


@contextlib.contextmanager
def zenoh(*, ahead: bool = False) -> Iterator[str]:
    """Run T2's router; ahead of ordinary processes when it is told to, as in T2."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with running(
        module(
            "cli router", *given(f"bus.listen={endpoint}", f"robot.realtime={str(ahead).lower()}")
        )
    ):
        yield endpoint


UDP = Other("UDP", "udp", udp)
ZENOH = Other("Zenoh, a router", "zenoh", zenoh)
OTHERS = (
    Other("CycloneDDS", "dds", dds, "cyclonedds"),
    Other("ZeroMQ, IPC", "zmq", zmq, "pyzmq"),
    Other("LCM", "lcm", lcm, "lcm"),
    Other("MQTT, mosquitto", "mqtt", mqtt, "paho-mqtt", "mosquitto"),
    Other("Redis, unix socket", "redis", redis, "redis", "redis-server"),
    ZENOH,
)
