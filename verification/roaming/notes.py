"""What was on the bus, and when, noted where it was heard: one JSON object a line.

All times are the robot's monotonic clock, whoever noted them.
"""

from pathlib import Path
from typing import TypeVar

import msgspec
from msgspec import Struct

from common import keys
from common.bus.bus import Arrival, Bus
from common.keys import Topic
from common.loop import Loop
from common.messages import Message, Motion, SafetyState

M = TypeVar("M", bound=Message)

WRITE_S = 0.1
DEPTH = 256


class Note(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One message."""

    key: str  # below the robot's
    at_ns: int
    sent_ns: int
    seq: int
    heard_ns: int = 0  # of a motion: when the request came in that it answers; 0 if none
    judged_ns: int = 0  # of a motion: when the bumper sample came in that it knows
    latched: bool = False  # of safety's state


class Notebook:
    """Notes what is heard on a bus; ``ahead_ns`` is how far its clock is ahead of the robot's."""

    def __init__(self, file: Path, loop: Loop, ahead_ns: int = 0) -> None:
        self._ahead_ns = ahead_ns
        self._file = file.open("ab")
        loop.every(WRITE_S, lambda _: self._file.flush())

    def listen(self, bus: Bus, topic: Topic[M]) -> None:
        """Note what comes on a topic from the robot."""
        root = keys.ROOT + f"/{bus.robot}/"

        def take(arrival: Arrival[M]) -> None:
            path = arrival.key.removeprefix(root)
            self.note(path, arrival.message, arrival.received_ns, arrival.message.mono_ns)

        bus.subscribe(topic, take, depth=DEPTH)

    def note(self, path: str, message: Message, at_ns: int, sent_ns: int) -> None:
        """Note a message; ``at_ns`` by this host's clock, ``sent_ns`` by the robot's."""
        motion = message if isinstance(message, Motion) else None
        one = Note(
            key=path,
            at_ns=at_ns - self._ahead_ns,
            sent_ns=sent_ns,
            seq=message.seq,
            heard_ns=motion.heard_ns if motion else 0,
            judged_ns=motion.judged_ns if motion else 0,
            latched=isinstance(message, SafetyState) and bool(message.latched),
        )
        self._file.write(msgspec.json.encode(one) + b"\n")


_notes = msgspec.json.Decoder(Note)


def read(file: Path, since_ns: int, until_ns: int) -> list[Note]:
    """Return what was noted in this time; the last line may still be half a one: left out."""
    lines = file.read_bytes().split(b"\n")[:-1] if file.exists() else []
    return [note for note in map(_notes.decode, lines) if since_ns <= note.at_ns < until_ns]
