"""WebSocket protocol: compresses texts, and sends pictures as they are.

A snapshot resembles the one before it: compressed, it takes about a tenth of the bytes, which a
link of 256 kbit/s has. JPEG does not become smaller, and would take 70 ms of CPU for each MB.
"""

from typing import TYPE_CHECKING

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

if TYPE_CHECKING:
    from uvicorn._types import ASGISendEvent


class WebSocketProtocol(WebSocketsSansIOProtocol):
    """uvicorn's protocol; its compression is negotiated once for both kinds of messages."""

    async def send(self, message: "ASGISendEvent") -> None:
        """Send a message, without compression if it is binary."""
        if message["type"] != "websocket.send" or message.get("bytes") is None:
            await super().send(message)
            return
        while not self.writable.is_set():  # then nothing is received until the message is sent
            await self.writable.wait()
        extensions, self.conn.extensions = self.conn.extensions, []
        try:
            await super().send(message)
        finally:
            self.conn.extensions = extensions
