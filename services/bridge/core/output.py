"""What the core wants carried out, one output at a time. Pure."""

from collections.abc import Iterator
from typing import Any

from msgspec import Struct

from t2.messages import Command, EventName, Field, Level, Message, Phrases


class Send(Struct, frozen=True):
    """A datagram to the board, from the UDP port of this index."""

    datagram: bytes
    port: int
    order: Command | None = None  # of a motion command


class Publish(Struct, frozen=True):
    """A message for the bus; ``stream`` names its publisher."""

    stream: str
    message: Message
    raw: bytes | None = None


class Event(Struct, frozen=True):
    """A transition, for the bus and the log."""

    name: EventName
    level: Level
    about: dict[str, Field] = {}
    phrases: Phrases = ()  # without any it has the text of its name


class Reply(Struct, frozen=True):
    """The answer to a call."""

    caller: Any  # a ``common.bus.bus.Caller``
    reply: Struct


class Refuse(Struct, frozen=True):
    """The refusal of a call, with its reasons."""

    caller: Any
    reasons: Phrases


class Reacted(Struct, frozen=True):
    """A reaction that ends now: all outputs before it are carried out."""

    name: str
    since_ns: int


Output = Send | Publish | Event | Reply | Refuse | Reacted
Outputs = Iterator[Output]
