"""Datagrams to frames and back.

A datagram holds one frame or several, back to back. A frame is a header and a payload,
little-endian (manual 2.1):

====== ======= ========================================================================
offset bytes   field
====== ======= ========================================================================
0      2       magic, ``47 53`` ("GS")
2      2       size of the whole frame, header included
4      2       command id, see ``commands`` and ``reports``
6      2       CRC, over the payload alone: the header is not protected
8      size-8  payload
====== ======= ========================================================================

Reading never raises. What is no frame becomes a ``Rejected`` run of bytes with one named reason,
and reading goes on at the next magic; the runs and the frames together are the whole datagram.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from struct import Struct
from typing import Literal

import crcmod.predefined

from common.errors import WireError
from common.wire.frame import Frame

MAGIC = b"GS"
HEADER = Struct("<2sHHH")
CRC_OFFSET, PAYLOAD_OFFSET = 6, 8

Covers = Literal["payload", "header_and_payload"]


class Reason(StrEnum):
    """Why bytes were not taken for a frame."""

    NO_MAGIC = "no_magic"
    TRUNCATED = "truncated"
    UNKNOWN_ID = "unknown_id"
    BAD_SIZE = "bad_size"
    BAD_CRC = "bad_crc"
    BAD_VALUE = "bad_value"


@dataclass(frozen=True, slots=True)
class Received:
    """A frame as it stood in the datagram, header and payload in ``raw``."""

    frame: Frame
    raw: bytes


@dataclass(frozen=True, slots=True)
class Rejected:
    """A run of bytes that is no frame, and why."""

    reason: Reason
    raw: bytes
    detail: str


class Framing:
    """Packs and reads frames with one CRC variant.

    crc: a name of ``crcmod.predefined``, 16 bits; ``crc-16`` is CRC-16/ARC, the board's.
    covers: ``payload``, or ``header_and_payload`` with the CRC field counted as zero.
    """

    def __init__(self, crc: str = "crc-16", covers: Covers = "payload") -> None:
        self._crc = crc_function(crc)
        self._covers_header = covers != "payload"

    def pack(self, frame: Frame) -> bytes:
        """Return the frame with its header."""
        payload = frame.to_bytes()
        size = HEADER.size + len(payload)
        crc = self._checksum(HEADER.pack(MAGIC, size, frame.ID, 0), payload)
        return HEADER.pack(MAGIC, size, frame.ID, crc) + payload

    def read(
        self, datagram: bytes, kinds: Mapping[int, type[Frame]]
    ) -> Iterator[Received | Rejected]:
        """Yield all that a datagram holds, in order; ``kinds`` is what its sender may say."""
        start = 0
        while start < len(datagram):
            part = self._read_one(datagram, start, kinds)
            start += len(part.raw)
            yield part

    def _read_one(
        self, datagram: bytes, start: int, kinds: Mapping[int, type[Frame]]
    ) -> Received | Rejected:
        if not datagram.startswith(MAGIC, start):
            return _reject(datagram, start, Reason.NO_MAGIC, "does not start with 47 53")
        left = len(datagram) - start
        if left < HEADER.size:
            return _reject(datagram, start, Reason.TRUNCATED, f"{left} bytes of an 8-byte header")
        _, size, command_id, crc = HEADER.unpack_from(datagram, start)
        kind = kinds.get(command_id)
        if kind is None:
            return _reject(datagram, start, Reason.UNKNOWN_ID, f"id 0x{command_id:04x}")
        expected = HEADER.size + kind.LAYOUT.size
        if size != expected:
            detail = f"{kind.__name__} has {expected} bytes, its header says {size}"
            return _reject(datagram, start, Reason.BAD_SIZE, detail)
        if left < size:
            return _reject(datagram, start, Reason.TRUNCATED, f"{left} of {size} bytes")
        return self._open(datagram, start, kind, crc)

    def _open(
        self, datagram: bytes, start: int, kind: type[Frame], crc: int
    ) -> Received | Rejected:
        raw = datagram[start : start + HEADER.size + kind.LAYOUT.size]
        payload = raw[PAYLOAD_OFFSET:]
        computed = self._checksum(raw[:CRC_OFFSET] + b"\0\0", payload)
        if computed != crc:
            detail = f"header says 0x{crc:04x}, the bytes give 0x{computed:04x}"
            return _reject(datagram, start, Reason.BAD_CRC, detail)
        try:
            return Received(kind.from_bytes(payload), raw)
        except WireError as error:
            return _reject(datagram, start, Reason.BAD_VALUE, str(error))

    def _checksum(self, header: bytes, payload: bytes) -> int:
        return self._crc(header + payload if self._covers_header else payload)


def crc_function(name: str) -> Callable[[bytes], int]:
    """Return a CRC of ``crcmod.predefined``; raise ``WireError`` for an unknown or wider one."""
    try:
        crc = crcmod.predefined.PredefinedCrc(name)
    except KeyError:
        raise WireError(f"no CRC is called {name!r}; the board's is 'crc-16'") from None
    if crc.digest_size != 2:
        raise WireError(f"CRC {name!r} has {crc.digest_size * 8} bits, the header has room for 16")
    function: Callable[[bytes], int] = crcmod.predefined.mkCrcFun(name)
    return function


def _reject(datagram: bytes, start: int, reason: Reason, detail: str) -> Rejected:
    """Give up everything from ``start`` to the next magic behind it."""
    following = datagram.find(MAGIC, start + 1)
    end = len(datagram) if following == -1 else following
    return Rejected(reason, datagram[start:end], detail)
