"""Connection test of the router's endpoints with plain sockets, to find problems below Zenoh."""

import socket
import ssl
import time
from pathlib import Path

from cli.inspect import remedies
from cli.inspect.diagnosis import Attempt
from common.settings import BusSettings

TIMEOUT_S = 2.0
ALERT_S = 0.3  # after the handshake, the router's alert about our certificate arrives within this
STREAMS = ("tcp", "tls", "ws")


def connect(endpoint: str, bus: BusSettings) -> Attempt:
    """Connect to one endpoint and return the result."""
    protocol, _, rest = endpoint.partition("/")
    address = rest.partition("?")[0].partition("#")[0]
    if protocol == "unixsock-stream":
        exists = Path(address).exists()
        return Attempt(endpoint, "" if exists else "the socket file is missing", remedies.NO_SOCKET)
    if protocol not in STREAMS:
        return Attempt(endpoint, tried=False)
    name, _, port = address.rpartition(":")
    host = name.strip("[]")
    begin_s = time.monotonic()
    trouble, todo = connect_tcp(host, int(port))
    took_s = time.monotonic() - begin_s
    if protocol == "tls" and not trouble:
        trouble, todo = handshake(host, int(port), bus)
    return Attempt(endpoint, trouble, todo, took_s)


def connect_tcp(host: str, port: int) -> tuple[str, str]:
    """Connect by TCP; return problem and remedy, both empty on success."""
    try:
        socket.create_connection((host, port), TIMEOUT_S).close()
    except socket.gaierror:
        return f"unknown host name {host}", remedies.NO_NAME
    except ConnectionRefusedError:
        return "connection refused: the host is up, but nothing listens", remedies.REFUSED
    except TimeoutError:
        return "no answer", remedies.NO_ROUTE
    except OSError as error:
        return (error.strerror or str(error)).lower(), remedies.NO_ROUTE
    return "", ""


def handshake(host: str, port: int, bus: BusSettings) -> tuple[str, str]:
    """Do a TLS handshake; return problem and remedy, both empty if both certificates are valid."""
    try:
        context = ssl.create_default_context(cafile=bus.ca)
        context.load_cert_chain(bus.certificate, bus.private_key)
    except OSError as error:  # the base class of SSLError
        reason = error.strerror or getattr(error, "reason", "") or str(error)
        return f"bus.ca, bus.certificate or bus.private_key is invalid: {reason}", remedies.KEYS
    try:
        with (
            socket.create_connection((host, port), TIMEOUT_S) as plain,
            context.wrap_socket(plain, server_hostname=host) as sock,
        ):
            sock.settimeout(ALERT_S)
            sock.recv(1)  # in TLS 1.3 the server checks our certificate after our handshake ends
    except ssl.SSLCertVerificationError as error:
        return f"the router's certificate is not trusted: {error.verify_message}", remedies.KEYS
    except ssl.SSLError as error:
        reason = (error.reason or str(error)).lower().replace("_", " ")
        return f"the router refuses this certificate: {reason}", remedies.KEYS
    except TimeoutError:
        return "", ""  # the router has accepted us and waits for the first message of a session
    except OSError as error:
        return (error.strerror or str(error)).lower(), remedies.NO_ROUTE
    return "the router closes the connection on this certificate", remedies.KEYS
