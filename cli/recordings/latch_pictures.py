"""The pictures around each latch of a recording, for ``t2 report``. Pure.

A recording holds two pictures a second of each camera. Of these a report shows the last ones before
a latch and the first ones after it, so that its size is bounded.
"""

from base64 import b64encode
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field

from t2.messages import Message, Picture, SafetyState

BEFORE, AFTER = 6, 4  # pictures of a latch
LATCHES_MAX = 10  # with pictures, in a report
MAGIC = b"\xff\xd8"  # of a JPEG


@dataclass(frozen=True, slots=True)
class TimedPicture:
    """A picture with its time (s) and its camera."""

    at_s: float
    camera: str
    picture: Picture

    @property
    def source(self) -> str:
        """The picture as a ``data:`` URL."""
        return f"data:image/jpeg;base64,{b64encode(self.picture.jpeg).decode()}"


@dataclass(slots=True)
class Latch:
    """A moment when causes latched, with the pictures around it."""

    at_s: float
    causes: tuple[str, ...]
    pictures: list[TimedPicture]
    after: int = 0  # of the pictures

    @property
    def shown(self) -> Iterator[tuple[str, TimedPicture]]:
        """Yield each picture with its time from the latch."""
        for one in self.pictures:
            yield f"{one.at_s - self.at_s:+.1f} s", one


@dataclass(slots=True)
class LatchPictures:
    """Collects the pictures, message by message."""

    latches: list[Latch] = field(default_factory=list)  # those with pictures
    _recent: deque[TimedPicture] = field(default_factory=lambda: deque(maxlen=BEFORE))
    _latched: frozenset[str] | None = None  # None until the first state

    def add(self, message: Message, key: str, at_s: float) -> None:
        """Add a message of a key."""
        if isinstance(message, SafetyState):
            self._add_state(message, at_s)
        elif isinstance(message, Picture) and message.jpeg.startswith(MAGIC):
            self._add_picture(TimedPicture(at_s, key.split("/")[-2], message))

    def _add_state(self, state: SafetyState, at_s: float) -> None:
        before, self._latched = self._latched, frozenset(state.latched)
        new = tuple(sorted(self._latched - before)) if before is not None else ()
        if new and len(self.latches) < LATCHES_MAX:
            self.latches.append(Latch(at_s, new, list(self._recent)))

    def _add_picture(self, one: TimedPicture) -> None:
        self._recent.append(one)
        if self.latches and self.latches[-1].after < AFTER:
            self.latches[-1].pictures.append(one)
            self.latches[-1].after += 1
