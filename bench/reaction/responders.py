"""Who reacts: each a few processes, up while its context lasts."""

import contextlib
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from bench.reaction.board import BREAK, HIT, STOP, Programs
from tests.support import free_port, wait_until

Start = Callable[[Programs, int, int], AbstractContextManager[None]]  # its port, the board's
Command = Sequence[str]


@dataclass(frozen=True, slots=True)
class Responder:
    """One row of the table."""

    name: str
    start: Start
    package: str = ""  # that it wants, by its name in requirements-bench.lock
    program: str = ""

    @property
    def lacks(self) -> str:
        """What is not installed here; empty when it can run."""
        try:
            if self.package:
                version(self.package)
        except PackageNotFoundError:
            return self.package
        return self.program if self.program and shutil.which(self.program) is None else ""


@contextlib.contextmanager
def running(*commands: Command) -> Iterator[None]:
    """Run these processes while the context lasts."""
    with contextlib.ExitStack() as stack:
        for command in commands:
            process = stack.enter_context(
                subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            )
            stack.callback(process.kill)
        yield


def module(name: str, *words: object) -> Command:
    """Return how a module is run."""
    return [sys.executable, "-m", *name.split(), *map(str, words)]


def echo(programs: Programs, port: int, _: int) -> AbstractContextManager[None]:
    """Run a C program that compares bytes."""
    return running([programs.echo, str(port), HIT, BREAK, STOP])


def alone(name: str) -> Start:
    """Run one process that is no service."""
    return lambda _, port, __: running(module(f"bench.reaction.{name}", port))


def stack(bridge: str) -> Start:
    """Run router, bridge, safety and an operator who resets: as shipped, with this bridge."""

    def start(_: Programs, port: int, board: int) -> AbstractContextManager[None]:
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        standby = free_port(socket.SOCK_DGRAM)
        sets = (
            f"board.port={board}",
            f"board.listen_ports=[{port}, {standby}]",
            f"bus.listen={endpoint}",
        )
        given = [word for each in sets for word in ("--set", each)]
        ours = [module(name, *given) for name in ("cli router", bridge, "services.safety")]
        return running(*ours, module("bench.reaction.resetter", endpoint))

    return start


def pair(name: str, port: int, where: object) -> AbstractContextManager[None]:
    """Run one process at the board and one that decides, on a bus that is there."""
    script = f"bench.reaction.by_{name}"
    return running(module(script, "judge", where), module(script, "board", port, where))


@contextlib.contextmanager
def by_zmq(_: Programs, port: int, __: int) -> Iterator[None]:
    """Run the pair on ZeroMQ."""
    with tempfile.TemporaryDirectory() as folder, pair("zmq", port, f"ipc://{folder}/bus"):
        yield


def by_dds(_: Programs, port: int, __: int) -> AbstractContextManager[None]:
    """Run the pair on CycloneDDS, in a domain that nobody else has."""
    return pair("dds", port, 1 + port % 200)


def by_lcm(_: Programs, port: int, __: int) -> AbstractContextManager[None]:
    """Run the pair on LCM; its packets stay on this host."""
    return pair("lcm", port, f"udpm://239.255.76.67:{free_port(socket.SOCK_DGRAM)}?ttl=0")


@contextlib.contextmanager
def by_mqtt(_: Programs, port: int, __: int) -> Iterator[None]:
    """Run the pair on MQTT, with a broker of its own on loopback."""
    broker = free_port()
    with running(["mosquitto", "-p", str(broker)]):
        wait_until(lambda: answers(broker), "mosquitto")
        with pair("mqtt", port, broker):
            yield


@contextlib.contextmanager
def by_redis(_: Programs, port: int, __: int) -> Iterator[None]:
    """Run the pair on Redis, with a server of its own that writes nothing down."""
    with tempfile.TemporaryDirectory() as folder:
        path = f"{folder}/redis.sock"
        server = ["redis-server", "--port", "0", "--unixsocket", path, "--save", ""]
        with running([*server, "--dir", folder]):
            wait_until(Path(path).exists, "redis-server")
            with pair("redis", port, path):
                yield


def answers(port: int) -> bool:
    """Tell whether somebody listens on a port of loopback."""
    with socket.socket() as sock:
        return sock.connect_ex(("127.0.0.1", port)) == 0


FLOOR, LOOP, REFLEX = "C, compares bytes", "Python, one process", "T2, reflex"
JUDGED, DDS = "T2, judged stop", "CycloneDDS"
RESPONDERS = (
    Responder(FLOOR, echo),
    Responder(LOOP, alone("loop")),
    Responder("asyncio, one process", alone("aio")),
    Responder(REFLEX, stack("services.bridge")),
    Responder(JUDGED, stack("bench.reaction.blunt")),
    Responder(DDS, by_dds, "cyclonedds"),
    Responder("ZeroMQ, IPC", by_zmq, "pyzmq"),
    Responder("LCM", by_lcm, "lcm"),
    Responder("MQTT, mosquitto", by_mqtt, "paho-mqtt", "mosquitto"),
    Responder("Redis, unix socket", by_redis, "redis", "redis-server"),
)
