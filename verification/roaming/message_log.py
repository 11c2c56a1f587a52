"""A log of received messages with times, one JSON object a line.

All times are the robot's monotonic clock, on both hosts.
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


class Entry(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One received message."""

    key: str  # below the robot's
    at_ns: int
    sent_ns: int
    seq: int
    heard_ns: int = 0  # of a motion: reception of the request that it answers; 0 if none
    judged_ns: int = 0  # of a motion: reception of its newest bumper sample
    latched: bool = False  # in safety's state


class MessageLog:
    """Writes entries; ``ahead_ns`` is the offset of this host's clock from the robot's."""

    def __init__(self, file: Path, loop: Loop, ahead_ns: int = 0) -> None:
        self._ahead_ns = ahead_ns
        self._file = file.open("ab")
        loop.every(WRITE_S, lambda _: self._file.flush())

    def subscribe(self, bus: Bus, topic: Topic[M]) -> None:
        """Entry what comes on a topic from the robot."""
        root = keys.ROOT + f"/{bus.robot}/"

        def take(arrival: Arrival[M]) -> None:
            path = arrival.key.removeprefix(root)
            self.add(path, arrival.message, arrival.received_ns, arrival.message.mono_ns)

        bus.subscribe(topic, take, depth=DEPTH)

    def add(self, path: str, message: Message, at_ns: int, sent_ns: int) -> None:
        """Entry a message; ``at_ns`` by this host's clock, ``sent_ns`` by the robot's."""
        motion = message if isinstance(message, Motion) else None
        one = Entry(
            key=path,
            at_ns=at_ns - self._ahead_ns,
            sent_ns=sent_ns,
            seq=message.seq,
            heard_ns=motion.heard_ns if motion else 0,
            judged_ns=motion.judged_ns if motion else 0,
            latched=isinstance(message, SafetyState) and bool(message.latched),
        )
        self._file.write(msgspec.json.encode(one) + b"\n")


_entries = msgspec.json.Decoder(Entry)


def read(file: Path, since_ns: int, until_ns: int) -> list[Entry]:
    """Return the entries of this period, without an incomplete last line."""
    lines = file.read_bytes().split(b"\n")[:-1] if file.exists() else []
    return [entry for entry in map(_entries.decode, lines) if since_ns <= entry.at_ns < until_ns]
