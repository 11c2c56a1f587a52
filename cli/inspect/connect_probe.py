"""Dials the router's endpoints as bare sockets: what is wrong below Zenoh shows here."""

import socket
import ssl
import time
from pathlib import Path

from cli.inspect import remedies
from cli.inspect.diagnosis import Dial
from common.settings import BusSettings

PATIENCE_S = 2.0
ALERT_S = 0.3  # after the handshake, until the other end has said that it refuses us
STREAMS = ("tcp", "tls", "ws")


def dial(endpoint: str, bus: BusSettings) -> Dial:
    """Return what comes of it; takes seconds at most where a name is known."""
    protocol, _, rest = endpoint.partition("/")
    address = rest.partition("?")[0].partition("#")[0]
    if protocol == "unixsock-stream":
        there = Path(address).exists()
        return Dial(endpoint, "" if there else "there is no such file", remedies.NO_SOCKET)
    if protocol not in STREAMS:
        return Dial(endpoint, tried=False)
    host, _, port = address.rpartition(":")
    begin_s = time.monotonic()
    trouble, todo = connect(host.strip("[]"), int(port))
    took_s = time.monotonic() - begin_s
    if protocol == "tls" and not trouble:
        trouble, todo = handshake(host.strip("[]"), int(port), bus)
    return Dial(endpoint, trouble, todo, took_s)


def connect(host: str, port: int) -> tuple[str, str]:
    """Return what is wrong with connecting and what to do about it; nothing when it is well."""
    try:
        socket.create_connection((host, port), PATIENCE_S).close()
    except socket.gaierror:
        return f"the name {host} is not known", remedies.NO_NAME
    except ConnectionRefusedError:
        return "the host is there, and nothing listens", remedies.REFUSED
    except TimeoutError:
        return "there is no answer", remedies.NO_WAY
    except OSError as error:
        return (error.strerror or str(error)).lower(), remedies.NO_WAY
    return "", ""


def handshake(host: str, port: int, bus: BusSettings) -> tuple[str, str]:
    """Return what is wrong with the certificates of either end; nothing when both are taken."""
    try:
        context = ssl.create_default_context(cafile=bus.ca)
        context.load_cert_chain(bus.certificate, bus.private_key)
    except OSError as error:  # an SSLError is one, too
        reason = error.strerror or getattr(error, "reason", "") or str(error)
        return f"bus.ca, bus.certificate or bus.private_key is of no use: {reason}", remedies.KEYS
    try:
        with (
            socket.create_connection((host, port), PATIENCE_S) as plain,
            context.wrap_socket(plain, server_hostname=host) as sock,
        ):
            sock.settimeout(ALERT_S)
            sock.recv(1)  # with TLS 1.3 the other end judges us when we are done
    except ssl.SSLCertVerificationError as error:
        return (
            f"the router's certificate is not to be trusted: {error.verify_message}",
            remedies.KEYS,
        )
    except ssl.SSLError as error:
        reason = (error.reason or str(error)).lower().replace("_", " ")
        return f"the router refuses this certificate: {reason}", remedies.KEYS
    except TimeoutError:
        return "", ""  # it waits for what a session begins with: it has taken us
    except OSError as error:
        return (error.strerror or str(error)).lower(), remedies.NO_WAY
    return "the router hangs up on this certificate", remedies.KEYS
