"""What goes over the other buses: m/s and rad/s, as a map like those of T2. Pure."""

from collections.abc import Callable

import msgpack

Say = Callable[[float, float], object]  # m/s, rad/s


def packed(linear: float, angular: float) -> bytes:
    """Return both as MessagePack."""
    raw: bytes = msgpack.packb({"linear": linear, "angular": angular})
    return raw


def unpacked(raw: bytes) -> tuple[float, float]:
    """Return both."""
    fields = msgpack.unpackb(raw)
    return fields["linear"], fields["angular"]
