"""``python -m bench.reaction.asyncio_loop PORT``: ``loop`` with asyncio."""

import asyncio
import sys
from typing import cast

from bench.reaction.loop import BREAK, STOP, command, is_hit


class Answering(asyncio.DatagramProtocol):
    """Answers a bumper hit with BRAKE and everything else with STOP."""

    def __init__(self) -> None:
        self._stop, self._brake = command(STOP), command(BREAK)
        self._transport: asyncio.DatagramTransport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Store the transport."""
        self._transport = cast(asyncio.DatagramTransport, transport)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Answer one datagram."""
        self._transport.sendto(self._brake if is_hit(data) else self._stop, addr)


async def main() -> None:
    """Answer until killed."""
    loop = asyncio.get_running_loop()
    here = ("127.0.0.1", int(sys.argv[1]))
    await loop.create_datagram_endpoint(Answering, local_addr=here)
    await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(main())
