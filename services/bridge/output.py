"""Output of one input of the core: frames, messages, events, answers. Pure."""

from typing import Any

from msgspec import Struct, field

from common.messages import Level, Message
from common.motion import Command


class Send(Struct, frozen=True):
    """A datagram to the board, from the UDP port of this index."""

    datagram: bytes
    port: int
    order: Command | None = None  # of a motion command


class Event(Struct, frozen=True):
    """A transition, for the bus and the log."""

    name: str
    level: Level
    text: str
    about: dict[str, str | float | bool | None]


class Answer(Struct, frozen=True):
    """The answer to a call: a reply, or a refusal with its reason."""

    caller: Any  # with the methods of ``common.bus.calls.Caller``
    reply: Struct | None
    refusal: str = ""

    def give(self) -> None:
        """Send it to the caller."""
        if self.reply is None:
            self.caller.refuse(self.refusal)
        else:
            self.caller.reply(self.reply)


class Output(Struct):
    """Frames, messages, events and answers, each in their order."""

    sends: list[Send] = field(default_factory=list)
    messages: list[tuple[str, Message, bytes | None]] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    answers: list[Answer] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)  # for the log alone
    reported: bool = False  # whether ``Core.hit`` has handled a hit of this datagram
    hit: int | None = None  # ``seq`` of the bumper message that reports a new hit
    acked: bool = False  # whether that motion acknowledged the hit, and brakes

    def publish(self, stream: str, message: Message, raw: bytes | None = None) -> None:
        """Add a message for the bus; ``stream`` names its publisher."""
        self.messages.append((stream, message, raw))

    def event(self, name: str, level: Level, text: str, **about: str | float | bool | None) -> None:
        """Add an event."""
        self.events.append(Event(name, level, text, about))

    def reply(self, caller: Any, reply: Struct) -> None:
        """Add the reply to a call."""
        self.answers.append(Answer(caller, reply))

    def refuse(self, caller: Any, reason: str) -> None:
        """Add the refusal of a call."""
        self.answers.append(Answer(caller, None, reason))
