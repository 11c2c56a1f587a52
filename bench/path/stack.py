"""T2 as shipped: router, guard, bridge and safety, and how somebody else joins them."""

import contextlib
import io
import json
import socket
import tempfile
from collections.abc import Iterator
from pathlib import Path

from bench.path.processes import Command, given, module, running
from common.settings import BusSettings
from verification.harness.bus import at
from verification.harness.certificates import ADDRESS, Site, dialling
from verification.harness.ports import free_port

ROBOT = "001"
BRIDGE, SAFETY = "services.bridge", "services.safety"
KEYS = ("ca", "certificate", "private_key", "members")
FOR_EVER = -1  # who dials waits until the router is there
# A velocity is told to laptops 10 times a second as shipped; here every one is waited for.
EVERY_ONE = "bus.laptop_rate=1000.0"


def services(
    board: int, port: int, *sets: str, bridge: str = BRIDGE, safety: str = SAFETY
) -> list[Command]:
    """Return how they are run, the router first, for a board at one port that talks to another."""
    standby = free_port(socket.SOCK_DGRAM)
    sets = (f"board.port={board}", f"board.listen_ports=[{port}, {standby}]", *sets)
    return [module(name, *given(*sets)) for name in ("cli router", bridge, safety)]


@contextlib.contextmanager
def local(board: int, port: int, *sets: str, safety: str = SAFETY) -> Iterator[BusSettings]:
    """Run them; tell how a client on the same host dials the router."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    sets = (f"bus.listen={endpoint}", *sets)
    with running(*services(board, port, *sets, safety=safety)):
        yield at(endpoint)


@contextlib.contextmanager
def secured(board: int, port: int, *sets: str) -> Iterator[BusSettings]:
    """Run them with the keys of a site; tell how a driver dials the router by mutual TLS."""
    with tempfile.TemporaryDirectory() as folder:
        with contextlib.redirect_stdout(io.StringIO()):
            site = Site(Path(folder))
            driver = site.member("driver", "anna", "--robot", ROBOT)
            robot = site.member("robot", ROBOT, "--address", ADDRESS)
        door = f"tls/{ADDRESS}:{free_port()}"
        onboard = f"unixsock-stream/{folder}/bus.sock"
        sets = (f"bus.listen=[{door!r}, {onboard!r}]", EVERY_ONE, *files(robot), *sets)
        with running(*services(board, port, *sets)):
            yield dialling(driver, door)


def files(bus: BusSettings) -> list[str]:
    """Return the settings that name keys."""
    return [f"bus.{name}={getattr(bus, name)}" for name in KEYS if getattr(bus, name)]


def joining(bus: BusSettings) -> list[str]:
    """Return the settings of who dials."""
    return [f"bus.connect={list(bus.connect)}", *files(bus)]


def plain(bus: BusSettings) -> str:
    """Return the configuration of who dials with nothing but Zenoh, as JSON."""
    connect = {"endpoints": list(bus.connect), "timeout_ms": FOR_EVER}
    config: dict[str, object] = {"mode": "client", "connect": connect}
    if bus.ca:
        tls = {
            "root_ca_certificate": bus.ca,
            "connect_certificate": bus.certificate,
            "connect_private_key": bus.private_key,
            "enable_mtls": True,
        }
        config["transport"] = {"link": {"tls": tls}}
    return json.dumps(config)
