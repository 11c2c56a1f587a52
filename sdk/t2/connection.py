"""Connecting: a Zenoh session to the robot's router, with or without a certificate."""

import importlib
import json
import os
import re
from pathlib import Path
from typing import Any

import zenoh

from t2.errors import LinkError
from t2.robot import Robot
from t2.stream import CONNECTED, check_process, robots_of
from t2.text_file import expanded, pem_problem, read_text

LOCAL = "tcp/127.0.0.1:7447"
SOURCE_PLACE = re.compile(r" at /\S+\.rs:\d+\.?")  # in Zenoh's errors
ROBOT = re.compile(r"[^/*$#?]*")
ENDPOINT = re.compile(r"(tcp|tls)/[^/\s]+:\d+([?#]\S*)?|unixsock-stream/\S+")
TIMEOUT_MS = 3_000
MAX_MESSAGE = 8 * 2**20  # larger ones are dropped; the messages of T2 are far smaller
FILES = {
    "ca": "root_ca_certificate",
    "certificate": "connect_certificate",
    "private_key": "connect_private_key",
}


def connect(robot: str = "", *, endpoint: str = "", config: str | Path | None = None) -> Robot:
    """Connect to the router of a robot; close the result, or use it in ``with``.

    ``robot`` is its id; it may be left out while the router has only one. ``endpoint`` is a Zenoh
    endpoint, by default ``tcp/127.0.0.1:7447``. ``config`` is a settings file of T2 with ``[bus]``,
    such as the ``bus.toml`` in a folder that ``t2 keys`` made. Raises ``LinkError``.

    >>> with t2.connect("001", endpoint=ENDPOINT) as robot:
    ...     print(robot.bumper.latest().pressed)
    False
    """
    if not ROBOT.fullmatch(robot):
        raise LinkError(f"{robot!r} is not the id of one robot, such as 001")
    session, address = open_session(endpoint, config)
    return Robot(session, robot or only_robot(session, address), address)


def robots(endpoint: str = "", *, config: str | Path | None = None) -> list[str]:
    """Return the ids of the robots at a router, for ``connect``; arguments and errors as there.

    >>> t2.robots(ENDPOINT)
    ['001']
    """
    session, _ = open_session(endpoint, config)
    with session:
        return robots_of(session)


def only_robot(session: zenoh.Session, address: str) -> str:
    """Return the id of the only robot at a router; close the session and raise without one."""
    names = robots_of(session)
    if len(names) == 1:
        return names[0]
    session.close()
    found = f"has the robots {', '.join(names)}" if names else "has no robot"
    raise LinkError(f'the router at {address} {found}: name one, as in t2.connect("001")')


def open_session(endpoint: str, config: str | Path | None) -> tuple[zenoh.Session, str]:
    """Return a session, and the address of its router."""
    bus = read(Path(config)) if config else {}
    check_process()
    CONNECTED.add(os.getpid())
    addresses = [endpoint] if endpoint else bus.get("connect") or [LOCAL]
    for address in addresses:
        if not ENDPOINT.fullmatch(address):
            raise LinkError(f"{address!r} is no endpoint, such as {LOCAL} or tls/ROBOT:7447")
    if any(address.startswith(("tls/", "quic/")) for address in addresses):
        check_key(bus)
    try:
        made = zenoh.open(zenoh.Config.from_json5(json.dumps(settings(addresses, bus))))
    except zenoh.ZError as error:
        raise LinkError(
            f"no router answers at {', '.join(addresses)}: is `t2 up` running there? "
            f"`t2 doctor` finds the reason. Zenoh: {SOURCE_PLACE.sub('', str(error))}"
        ) from error
    return made, addresses[0]


def read(file: Path) -> dict[str, Any]:
    """Return the table ``[bus]`` of a settings file; its file names are relative to the file."""
    try:
        toml = importlib.import_module("tomllib")
    except ModuleNotFoundError:
        raise LinkError("config= needs Python 3.11 or newer; pass endpoint= instead") from None
    try:
        file = Path(expanded(str(file)))
        bus: dict[str, Any] = toml.loads(read_text(file)).get("bus", {})
        names = {name: expanded(str(bus[name])) for name in FILES if bus.get(name)}
    except (OSError, ValueError) as error:
        raise LinkError(f"{file}: {getattr(error, 'strerror', error)}") from None
    return bus | {name: str(file.parent / each) for name, each in names.items()}


def check_key(bus: dict[str, Any]) -> None:
    """Raise ``LinkError`` for an encrypted private key: Zenoh names no reason."""
    try:
        problem = pem_problem(Path(bus["private_key"]).read_bytes())
    except (KeyError, OSError):
        return  # the connection fails, with Zenoh's reason
    if problem:
        raise LinkError(f"bus.private_key {bus['private_key']}: {problem}")


def settings(endpoints: list[str], bus: dict[str, Any]) -> dict[str, Any]:
    """Return Zenoh's configuration of a client."""
    link: dict[str, Any] = {"rx": {"max_message_size": MAX_MESSAGE}}
    if bus.get("ca"):
        tls = {name: bus.get(ours, "") for ours, name in FILES.items()}
        link["tls"] = tls | {"enable_mtls": True}
    return {
        "mode": "client",
        "connect": {"endpoints": list(endpoints), "timeout_ms": TIMEOUT_MS},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {"shared_memory": {"enabled": False}, "link": link},
    }
