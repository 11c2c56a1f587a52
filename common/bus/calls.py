"""Calls: the far end of one that a service answers, and the answers to one that we made."""

import contextlib
from collections.abc import Callable
from typing import Any, Generic, TypeVar

import zenoh
from msgspec import Struct

from common import codec
from common.errors import MessageError
from common.keys import Call

R = TypeVar("R", bound=Struct)


class Caller(Generic[R]):
    """The other end of a call that is being served; answer it once, now or later."""

    def __init__(self, query: zenoh.Query, key: str) -> None:
        self._query = query
        self._key = key

    def reply(self, message: R) -> None:
        """Answer with the reply that the call promises."""
        encoding = codec.encoding(type(message))
        with contextlib.suppress(zenoh.ZError):  # the caller may be gone
            self._query.reply(self._key, codec.encode(message), encoding=encoding)
        self._query.drop()

    def refuse(self, reason: str) -> None:
        """Answer with the reason why not."""
        with contextlib.suppress(zenoh.ZError):
            self._query.reply_err(reason.encode(), encoding="text/plain")
        self._query.drop()


class Answers(Generic[R]):
    """Takes what comes back for a call; exactly one of the two handlers follows."""

    def __init__(
        self,
        call: Call[Any, R],
        on_reply: Callable[[R], None],
        on_refusal: Callable[[str], None],
        hand_over: Callable[[Callable[[], None]], None],
    ) -> None:
        self._call = call
        self._on_reply = on_reply
        self._on_refusal = on_refusal
        self._hand_over = hand_over
        self._answered = False

    def queue(self, reply: zenoh.Reply) -> None:
        """Take one answer, on a thread of Zenoh's."""
        if _is_timeout(reply):
            return  # the end follows
        if not self._answered:
            self._answered = True
            self._hand_over(lambda: self._read(reply))

    def end(self) -> None:
        """Take the end of the answers, on a thread of Zenoh's."""
        if not self._answered:
            self._hand_over(lambda: self._on_refusal(f"{self._call.server} does not answer"))

    def _read(self, reply: zenoh.Reply) -> None:
        if reply.ok is None:
            error = reply.err.payload.to_bytes() if reply.err else b""
            self._on_refusal(error.decode(errors="replace"))
            return
        try:
            message = codec.decode(reply.ok.payload.to_bytes(), self._call.reply)
        except MessageError as wrong:
            self._on_refusal(str(wrong))
        else:
            self._on_reply(message)


def _is_timeout(reply: zenoh.Reply) -> bool:
    """Tell Zenoh's own "Timeout", said by our session or by the router, from a server's refusal."""
    if reply.err is None or reply.err.encoding == zenoh.Encoding.TEXT_PLAIN:
        return False
    return reply.err.payload.to_bytes() == b"Timeout"
