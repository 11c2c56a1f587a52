"""Dials the router's endpoints as bare sockets: what is wrong below Zenoh shows here."""

import socket
import time
from pathlib import Path

from cli.inspect import advice
from cli.inspect.diagnosis import Dial

PATIENCE_S = 2.0
STREAMS = ("tcp", "tls", "ws")


def dial(endpoint: str) -> Dial:
    """Return what comes of it; takes two seconds at most where a name is known."""
    protocol, _, rest = endpoint.partition("/")
    address = rest.partition("?")[0].partition("#")[0]
    if protocol == "unixsock-stream":
        there = Path(address).exists()
        return Dial(endpoint, "" if there else "there is no such file", advice.NO_SOCKET)
    if protocol not in STREAMS:
        return Dial(endpoint, tried=False)
    host, _, port = address.rpartition(":")
    begin_s = time.monotonic()
    trouble, todo = connect(host.strip("[]"), int(port))
    return Dial(endpoint, trouble, todo, time.monotonic() - begin_s)


def connect(host: str, port: int) -> tuple[str, str]:
    """Return what is wrong with connecting and what to do about it; nothing when it is well."""
    try:
        socket.create_connection((host, port), PATIENCE_S).close()
    except socket.gaierror:
        return f"the name {host} is not known", advice.NO_NAME
    except ConnectionRefusedError:
        return "the host is there, and nothing listens", advice.REFUSED
    except TimeoutError:
        return "there is no answer", advice.NO_WAY
    except OSError as error:
        return (error.strerror or str(error)).lower(), advice.NO_WAY
    return "", ""
