"""Calls: the caller of a served call, and the answers to a call that was made."""

import contextlib
from collections.abc import Callable
from typing import Generic, TypeVar

import zenoh
from msgspec import Struct

from common import codec
from common.errors import MessageError
from common.operator import no_answer

R = TypeVar("R", bound=Struct)
A = TypeVar("A")  # a decoded answer: a call's reply, or raw bytes


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


class Answers(Generic[A]):
    """Collects the answers to a query; exactly one of both handlers is called.

    ``read`` decodes the payload, or raises ``MessageError``.
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
        """Process one answer, on a thread of Zenoh."""
        if is_timeout(reply):
            return  # ``end`` follows
        if not self._answered:
            self._answered = True
            self._hand_over(lambda: self._read(reply))

    def end(self) -> None:
        """Process the end of the answers, on a thread of Zenoh."""
        if not self._answered:
            self.fail(no_answer(self._server))

    def fail(self, reason: str) -> None:
        """Report a refusal, from any thread."""
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
    """Return whether a reply is Zenoh's own "Timeout", not a server's refusal."""
    if reply.err is None or reply.err.encoding == zenoh.Encoding.TEXT_PLAIN:
        return False
    return reply.err.payload.to_bytes() == b"Timeout"
