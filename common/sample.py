"""What was put on a key, just as it came: no type is asked of it."""

from msgspec import Struct


class Sample(Struct, frozen=True):
    """A sample as it came: ``received_ns`` on the monotonic clock, ``wall_ns`` on the other."""

    key: str
    payload: bytes
    encoding: str
    deleted: bool  # it was no PUT
    raw: bytes | None  # what was attached: the board's raw frame, on the bridge's streams
    received_ns: int
    wall_ns: int

    @property
    def size(self) -> int:
        """Return its bytes, without what the network puts around it."""
        return len(self.payload) + len(self.raw or b"")
