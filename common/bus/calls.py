"""Calls: the far end of one that a service answers, and the answers to one that we made."""

import contextlib
from collections.abc import Callable
from typing import Generic, TypeVar

import zenoh
from msgspec import Struct

from common import codec
from common.errors import MessageError

R = TypeVar("R", bound=Struct)
A = TypeVar("A")  # an answer, read: a call's reply, or bare bytes


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


class Answers(Generic[A]):
    """Takes what comes back for a query; exactly one of the two handlers follows.

    ``read`` makes an answer of the payload, or raises ``MessageError``.
    """

    def __init__(
        self,
        server: str,
        read: Callable[[bytes], A],
        on_reply: Callable[[A], None],
        on_refusal: Callable[[str], None],
        hand_over: Callable[[Callable[[], None]], None],
    ) -> None:
        self._server = server
        self._to_answer = read
        self._on_reply = on_reply
        self._on_refusal = on_refusal
        self._hand_over = hand_over
        self._answered = False

    def queue(self, reply: zenoh.Reply) -> None:
        """Take one answer, on a thread of Zenoh's."""
        if is_timeout(reply):
            return  # the end follows
        if not self._answered:
            self._answered = True
            self._hand_over(lambda: self._read(reply))

    def end(self) -> None:
        """Take the end of the answers, on a thread of Zenoh's."""
        if not self._answered:
            self.fail(f"{self._server} does not answer; `t2 doctor` tells why")

    def fail(self, reason: str) -> None:
        """Let the refusal follow, from any thread."""
        self._hand_over(lambda: self._on_refusal(reason))

    def _read(self, reply: zenoh.Reply) -> None:
        if reply.ok is None:
            error = reply.err.payload.to_bytes() if reply.err else b""
            self._on_refusal(error.decode(errors="replace"))
            return
        try:
            message = self._to_answer(reply.ok.payload.to_bytes())
        except MessageError as wrong:
            self._on_refusal(str(wrong))
        else:
            self._on_reply(message)


def is_timeout(reply: zenoh.Reply) -> bool:
    """Tell Zenoh's own "Timeout", said by our session or by the router, from a server's refusal."""
    if reply.err is None or reply.err.encoding == zenoh.Encoding.TEXT_PLAIN:
        return False
    return reply.err.payload.to_bytes() == b"Timeout"
