"""T2 as shipped, router, guard, bridge and safety, and the settings of its clients."""

import contextlib
import io
import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

from bench.path.processes import Command, module, running
from common.settings import BusSettings
from verification.harness.bus import at, set_options
from verification.harness.certificates import ADDRESS, Site, connecting
from verification.harness.ports import free_port, udp_ports

ROBOT = "001"
BRIDGE, SAFETY = "services.bridge", "services.safety"
KEYS = ("ca", "certificate", "private_key", "members")
WAIT_FOREVER = -1  # a client waits until the router listens
# As shipped a TLS client receives 10 velocities a second; the benchmark waits for each one.
NOT_THINNED = "bus.laptop_rate=1000.0"


def services(
    board: int, port: int, *sets: str, bridge: str = BRIDGE, safety: str = SAFETY
) -> list[Command]:
    """Return their commands, the router first, for a board and the port that it sends to."""
    (standby,) = udp_ports(1)
    sets = (f"board.port={board}", f"board.listen_ports=[{port}, {standby}]", *sets)
    return [module(name, *set_options(*sets)) for name in ("cli router", bridge, safety)]


@contextlib.contextmanager
def local(board: int, port: int, *sets: str, safety: str = SAFETY) -> Iterator[BusSettings]:
    """Run them; yield the settings of a client on the same host."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    sets = (f"bus.listen={endpoint}", *sets)
    with running(*services(board, port, *sets, safety=safety)):
        yield at(endpoint)


@contextlib.contextmanager
def secured(board: int, port: int, *sets: str) -> Iterator[BusSettings]:
    """Run them with certificates of a site; yield the settings of a driver with mutual TLS."""
    with tempfile.TemporaryDirectory() as folder:
        with contextlib.redirect_stdout(io.StringIO()):
            site = Site(Path(folder))
            driver = site.member("driver", "anna", "--robot", ROBOT)
            robot = site.member("robot", ROBOT, "--address", ADDRESS)
        endpoint = f"tls/{ADDRESS}:{free_port()}"
        onboard = f"unixsock-stream/{folder}/bus.sock"
        sets = (f"bus.listen=[{endpoint!r}, {onboard!r}]", NOT_THINNED, *files(robot), *sets)
        with running(*services(board, port, *sets)):
            yield connecting(driver, endpoint)


def files(bus: BusSettings) -> list[str]:
    """Return the settings of the certificate files."""
    return [f"bus.{name}={getattr(bus, name)}" for name in KEYS if getattr(bus, name)]


def client_sets(bus: BusSettings) -> list[str]:
    """Return the settings of a client."""
    return [f"bus.connect={list(bus.connect)}", *files(bus)]


def plain(bus: BusSettings) -> str:
    """Return the Zenoh configuration of a client without T2, as JSON."""
    connect = {"endpoints": list(bus.connect), "timeout_ms": WAIT_FOREVER}
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
