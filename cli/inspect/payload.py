"""What a payload says: by its encoding, else as MessagePack, else in hexadecimal. Never raises."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import msgspec
from msgspec import Struct

from common import codec, keys
from common import messages as m
from common.errors import MessageError

UNREADABLE = (msgspec.MsgspecError, RecursionError, UnicodeDecodeError, ValueError)


@dataclass(frozen=True, slots=True)
class Reading:
    """A payload, read; ``complaint`` says what is wrong with it, empty when nothing is."""

    kind: str  # Odometry, json, text, msgpack, bytes, empty
    value: Any
    complaint: str = ""


def read(payload: bytes, encoding: str) -> Reading:
    """Read a payload as well as it can be read."""
    if not payload:
        return Reading("empty", None)
    if encoding.startswith("application/json"):
        return _json(payload)
    if encoding.startswith("text/"):
        return Reading("text", payload.decode(errors="replace"))
    name = codec.kind_of(encoding)
    try:
        value = msgspec.msgpack.decode(payload)
    except UNREADABLE:
        return Reading("bytes", payload, "no MessagePack")
    return Reading(name or "msgpack", value, _complaint(payload, name))


@cache
def kinds() -> dict[str, type[Struct]]:
    """Return every struct of the contract by its name."""
    of_calls: list[type[Struct]] = [k for call in keys.CALLS for k in (call.request, call.reply)]
    inner: tuple[type[Struct], ...] = (m.Cause, m.Limits, m.Timing, m.Durations, m.Message)
    of_topics: list[type[Struct]] = [topic.message for topic in keys.TOPICS]
    return {kind.__name__: kind for kind in (*of_topics, *of_calls, *inner)}


def at(value: Any, path: str) -> Any:
    """Return what stands at ``causes.0.name``; raise ``MessageError`` naming what there is."""
    here = value
    for part in path.split("."):
        if isinstance(here, dict) and part in here:
            here = here[part]
        elif isinstance(here, list) and part.isdigit() and int(part) < len(here):
            here = here[int(part)]
        else:
            raise MessageError(f"there is no {part!r} of {path!r}; there is: {_names(here)}")
    return here


def _json(payload: bytes) -> Reading:
    try:
        return Reading("json", msgspec.json.decode(payload))
    except UNREADABLE:
        return Reading("bytes", payload, "no JSON")


def _complaint(payload: bytes, name: str) -> str:
    kind = kinds().get(name)
    if name and kind is None:
        return f"{name} is unknown here"
    try:
        if kind:
            codec.decode(payload, kind)
    except MessageError as error:
        return str(error)
    return ""


def _names(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(map(str, value)) or "nothing in it"
    if isinstance(value, list):
        return f"0 to {len(value) - 1}" if value else "nothing in it"
    return "a single value"
