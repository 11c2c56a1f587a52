"""Calls: the caller of a served call, and what a reply means."""

import contextlib
from typing import Generic, TypeVar

import zenoh
from msgspec import Struct

from common import codec

R = TypeVar("R", bound=Struct)


class Caller(Generic[R]):
    """The caller of a served call; answer it once, now or later."""

    def __init__(self, query: zenoh.Query, key: str) -> None:
        self._query = query
        self._key = key

    def reply(self, message: R) -> None:
        """Answer with the reply."""
        encoding = codec.encoding(type(message))
        with contextlib.suppress(zenoh.ZError):  # the caller may have disconnected
            self._query.reply(self._key, codec.encode(message), encoding=encoding)
        self._query.drop()

    def refuse(self, reason: str) -> None:
        """Answer with the reason of the refusal."""
        with contextlib.suppress(zenoh.ZError):
            self._query.reply_err(reason.encode(), encoding="text/plain")
        self._query.drop()


def is_timeout(reply: zenoh.Reply) -> bool:
    """Return whether a reply is Zenoh's own "Timeout", not a server's refusal."""
    if reply.err is None or reply.err.encoding == zenoh.Encoding.TEXT_PLAIN:
        return False
    return reply.err.payload.to_bytes() == b"Timeout"


def refusal_of(reply: zenoh.Reply) -> str:
    """Return the reason of a refusal."""
    reason = reply.err.payload.to_bytes() if reply.err else b""
    return reason.decode(errors="replace") or "refused without a reason"
