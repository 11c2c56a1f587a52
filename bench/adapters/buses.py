"""The other buses: the broker that each needs, and its adapter."""

import contextlib
import socket
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from bench.path.processes import module, running
from verification.harness.bus import set_options
from verification.harness.ports import accepts_connections, free_port
from verification.harness.waiting import wait_until


@dataclass(frozen=True, slots=True)
class OtherBus:
    """A bus; its context runs the broker and yields the address."""

    title: str
    name: str  # of its adapter
    run: Callable[[], AbstractContextManager[str]]
    package: str = ""  # required, by its name in requirements-bench.lock
    program: str = ""


@contextlib.contextmanager
def udp() -> Iterator[str]:
    """Yield a UDP port."""
    yield str(free_port(socket.SOCK_DGRAM))


@contextlib.contextmanager
def zmq() -> Iterator[str]:
    """Yield an IPC address."""
    with tempfile.TemporaryDirectory() as folder:
        yield f"ipc://{folder}/bus"


@contextlib.contextmanager
def dds() -> Iterator[str]:
    """Yield an unused domain."""
    yield str(1 + free_port() % 200)


@contextlib.contextmanager
def lcm() -> Iterator[str]:
    """Yield a multicast URL whose packets stay on this host."""
    yield f"udpm://239.255.76.67:{free_port(socket.SOCK_DGRAM)}?ttl=0"


@contextlib.contextmanager
def mqtt() -> Iterator[str]:
    """Run a broker on loopback."""
    broker = free_port()
    with running(["mosquitto", "-p", str(broker)]):
        wait_until(lambda: accepts_connections(broker), "mosquitto")
        yield str(broker)


@contextlib.contextmanager
def redis() -> Iterator[str]:
    """Run a server without persistence."""
    with tempfile.TemporaryDirectory() as folder:
        path = f"{folder}/redis.sock"
        server = ["redis-server", "--port", "0", "--unixsocket", path, "--save", ""]
        with running([*server, "--dir", folder]):
            wait_until(Path(path).exists, "redis-server")
            yield path


@contextlib.contextmanager
def zenoh(*, realtime: bool = False) -> Iterator[str]:
    """Run the T2 router; with ``realtime`` as SCHED_FIFO, as in T2."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with running(
        module(
            "cli router",
            *set_options(f"bus.listen={endpoint}", f"robot.realtime={str(realtime).lower()}"),
        )
    ):
        yield endpoint


UDP = OtherBus("UDP", "udp", udp)
ZENOH = OtherBus("Zenoh, a router", "zenoh", zenoh)
OTHERS = (
    OtherBus("CycloneDDS", "dds", dds, "cyclonedds"),
    OtherBus("ZeroMQ, IPC", "zmq", zmq, "pyzmq"),
    OtherBus("LCM", "lcm", lcm, "lcm"),
    OtherBus("MQTT, mosquitto", "mqtt", mqtt, "paho-mqtt", "mosquitto"),
    OtherBus("Redis, unix socket", "redis", redis, "redis", "redis-server"),
    ZENOH,
)
