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


def no_answer(server: str) -> str:
    """Return the text of a call without any answer."""
    return f"{server} does not answer; run `t2 doctor`"


def not_allowed(server: str) -> str:
    """Return the text of a call without any answer from a service whose messages arrive.

    A router whose access rules forbid a call drops it without an error.
    """
    return f"no reply, though {server} runs: this certificate may not call it (see `t2 keys list`)"
