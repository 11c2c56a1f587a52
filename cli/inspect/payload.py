"""Decoding of any payload: by its encoding, without one as MessagePack. Never raises."""

from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import msgspec
from msgspec import Struct

from t2 import codec, keys
from t2.errors import MessageError
from t2.messages import Phrases
from t2.words import Language, render

_CALLED: list[type[Struct]] = [kind for call in keys.CALLS for kind in (call.request, call.reply)]
_PUBLISHED: list[type[Struct]] = [topic.message for topic in keys.TOPICS]
KINDS = {kind.__name__: kind for kind in (*_PUBLISHED, *_CALLED)}
# Without an encoding a payload is "zenoh/bytes", and may be anything: MessagePack is tried.
KNOWN = ("application/json", "application/msgpack", "zenoh/bytes")
# Texts of messages, and the phrases with the same content.
TEXTS = {
    "text": "phrases", "waiting": "waiting_phrases", "release_refusal": "refusal_phrases",
}  # fmt: skip
UNREADABLE = (msgspec.MsgspecError, RecursionError, UnicodeDecodeError, ValueError)


@dataclass(frozen=True, slots=True)
class Reading:
    """A decoded payload; ``complaint`` is the reason why it is invalid, empty when valid."""

    kind: str  # Odometry, json, text, msgpack, bytes, empty
    value: Any
    complaint: str = ""


def read(payload: bytes, encoding: str) -> Reading:
    """Decode a payload as far as possible."""
    if not payload:
        return Reading("empty", None)
    if encoding.startswith(("text/", "zenoh/string")):
        return Reading("text", payload.decode(errors="replace"))
    if encoding and not encoding.startswith(KNOWN):
        return Reading(encoding, payload)
    form = "JSON" if encoding.startswith("application/json") else "MessagePack"
    try:
        if form == "JSON":
            return Reading("json", msgspec.json.decode(payload))
        value = msgspec.msgpack.decode(payload)
    except UNREADABLE:
        return Reading("bytes", payload, f"not {form}")
    name = codec.kind_of(encoding)
    return Reading(name or "msgpack", value, _complaint(value, name))


def localized(value: Any, language: Language) -> Any:
    """Return a decoded message with its texts in a language, and without their phrases."""
    if isinstance(value, list):
        return [localized(each, language) for each in value]
    if not isinstance(value, dict):
        return value
    shown = {name: localized(each, language) for name, each in value.items()}
    for text, phrases in TEXTS.items():
        with suppress(*UNREADABLE, KeyError):
            known = msgspec.convert(value[phrases], Phrases)
            shown[text] = render(known, language, value[text])
            del shown[phrases]
    return shown


def at(value: Any, path: str) -> Any:
    """Return the value at ``causes.0.name``; raise ``MessageError`` naming the existing fields.

    A list may have fewer elements, and a value may be unknown (None): both are None.
    """
    here = value
    for part in path.split("."):
        if here is None:
            return None
        if isinstance(here, dict) and part in here:
            here = here[part]
        elif isinstance(here, list) and part.isdecimal():
            here = here[int(part)] if int(part) < len(here) else None
        else:
            names = ", ".join(map(str, here)) if isinstance(here, dict) else ""
            names = "a number from 0" if isinstance(here, list) else names
            raise MessageError(f"{path!r} has no field {part!r}; available: {names or 'none'}")
    return here


def _complaint(value: Any, name: str) -> str:
    """Check a decoded value against the type that its encoding names."""
    if not name:
        return ""
    kind = KINDS.get(name)
    if kind is None:
        return f"unknown type {name}"
    try:
        msgspec.convert(value, kind)
    except UNREADABLE as error:
        return f"not a {name}: {error}"
    return ""
