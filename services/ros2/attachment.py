"""Attachment of every sample, request and reply: sequence, source time, sender. Pure.

rmw_zenoh drops a sample without one.
"""

import struct
from typing import NamedTuple

FORMAT = struct.Struct("<qqB16s")
GID_SIZE = 16


class Attachment(NamedTuple):
    """The 33 bytes of an attachment."""

    sequence: int  # from 1 for each sender
    source_ns: int  # the sender's wall clock
    gid: bytes  # 16 bytes that identify the sender

    def encode(self) -> bytes:
        """Return the bytes."""
        return FORMAT.pack(self.sequence, self.source_ns, GID_SIZE, self.gid)


def decode(raw: bytes) -> Attachment:
    """Return the attachment of these bytes; raise ``ValueError``."""
    if len(raw) != FORMAT.size:
        raise ValueError(f"an attachment has {FORMAT.size} bytes, not {len(raw)}")
    sequence, source_ns, size, gid = FORMAT.unpack(raw)
    if size != GID_SIZE:
        raise ValueError(f"a GID has {GID_SIZE} bytes, not {size}")
    return Attachment(sequence, source_ns, gid)
