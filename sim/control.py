"""The control socket: one JSON request in a UDP datagram, one JSON reply in another.

For tests and demonstrations on this host; it is off unless ``sim.control_port`` is set. Requests
are those of ``sim.requests``: ``{"do": "bumper", "pressed": true}``.
"""

import contextlib
import socket

import msgspec

from common.errors import LinkError, MessageError
from sim.injection import Injection, Reply
from sim.requests import Asked, GetTruth
from sim.trace import Truth
from sim.udp import LARGEST, bound, drain

HOST = "127.0.0.1"

_requests = msgspec.json.Decoder(Asked)
_replies = msgspec.json.Decoder(Reply)


class ControlSocket:
    """The simulator's end of the control socket."""

    def __init__(self, port: int, injection: Injection) -> None:
        self.sock = bound(HOST, port, "sim.control_port")
        self._injection = injection

    def serve(self, now_ns: int) -> None:
        """Answer the waiting requests."""
        for payload, sender in drain(self.sock):
            reply = self._answer(payload, now_ns)
            with contextlib.suppress(OSError):  # the client may be gone
                self.sock.sendto(msgspec.json.encode(reply), sender)

    def close(self) -> None:
        """Close the socket."""
        self.sock.close()

    def _answer(self, payload: bytes, now_ns: int) -> Reply:
        try:
            request = _requests.decode(payload)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
            return Reply(ok=False, error=str(error))
        return self._injection.handle(request, now_ns)


class Control:
    """A client of the control socket."""

    def __init__(self, port: int, timeout_s: float = 5.0) -> None:
        self._port = port
        self._timeout_s = timeout_s

    def do(self, request: Asked) -> Reply:
        """Send a request; ``MessageError`` when it is refused, ``LinkError`` when none answers."""
        try:
            reply = _replies.decode(self._exchange(msgspec.json.encode(request)))
        except OSError as error:  # includes timeouts
            raise LinkError(f"the simulator's control socket: {error}") from None
        if not reply.ok:
            raise MessageError(reply.error)
        return reply

    def truth(self) -> Truth:
        """Return the true state; errors as in ``do``."""
        truth = self.do(GetTruth()).truth
        assert truth is not None
        return truth

    def _exchange(self, payload: bytes) -> bytes:
        # A socket for each request: a late reply to an earlier one must not be taken for its own.
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            sock.settimeout(self._timeout_s)
            sock.connect((HOST, self._port))
            sock.send(payload)
            return sock.recv(LARGEST)
