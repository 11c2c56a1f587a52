"""What the end of a path tells the vehicle: which frame, and when by the monotonic clock. Pure."""

import struct

STAMP = struct.Struct("<Bq")


def stamped(kind: int, at_ns: int) -> bytes:
    """Return both in nine bytes."""
    return STAMP.pack(kind, at_ns)
