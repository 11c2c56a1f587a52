"""A raw sample of the bus, not decoded."""

from msgspec import Struct


class Sample(Struct, frozen=True):
    """A raw sample; ``received_ns`` on the monotonic clock, ``wall_ns`` on the wall clock."""

    key: str
    payload: bytes
    encoding: str
    deleted: bool  # a DELETE, not a PUT
    raw: bytes | None  # attachment: the board's raw frame, on the bridge's streams
    received_ns: int
    wall_ns: int

    @property
    def size(self) -> int:
        """Size in bytes, without network overhead."""
        return len(self.payload) + len(self.raw or b"")
