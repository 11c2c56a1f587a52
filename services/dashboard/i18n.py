"""Texts of the page in English and Chinese: its own labels, and phrases of the catalogue ``t2``.

The server renders both languages, so the page only picks one. A text from the bus without known
phrases, of a foreign or newer publisher, is shown as its publisher wrote it.
"""

from pathlib import Path
from typing import get_args

import msgspec
from msgspec import Struct

from common.text import line
from t2.catalogue import LATCHED, SERVICES, SOURCES
from t2.messages import Direction, Event, Field, Phrase, Phrases
from t2.words import LANGUAGES, Language, render

FILE = Path(__file__).with_name("texts.toml")
LABELS = msgspec.toml.decode(FILE.read_bytes(), type=dict[str, tuple[str, str]])


class Texts(Struct, frozen=True):
    """A text in both languages, for one line of the page."""

    en: str
    zh: str


# Sentences of the catalogue that the page shows by itself.
SENTENCES: dict[str, Phrases] = {
    **{
        name: (Phrase(name),)
        for name in (
            "root.router", "root.safety", "root.bridge", "root.relay", "root.board",
            "root.may_move", "call.not_connected", "reset.nothing", "next.by_hand",
            "next.reset_first", "release.no_contact", "event.estop_denied",
            "event.estop_unconfirmed",
        )
    },
    "next.move_off": (Phrase("contact"), Phrase("next.move_off")),
    **{
        f"release.forbidden_{direction}": (Phrase("release.forbidden", {"direction": direction}),)
        for direction in get_args(Direction)
    },
}  # fmt: skip
# Events whose text is the reason alone, by the label that adds what happened.
HAPPENED = {
    "stop": "stopped",
    "reset_refused": "reset_refused",
    "release_refused": "release_refused",
}
LATCHES = (*LATCHED, "driver_fault")  # events of safety; the label adds that a reset is due


def table() -> dict[Language, dict[str, str]]:
    """Return the texts that the page has from the start, by language and name."""
    return {
        language: {
            **{name: words[at] for name, words in LABELS.items()},
            **{name: render(phrases, language) for name, phrases in SENTENCES.items()},
            **{f"source.{name}": words[at] for name, words in SOURCES.items()},
        }
        for at, language in enumerate(LANGUAGES)
    }


def label(name: str, text: Texts | None = None) -> Texts:
    """Return a label of the page, with a text in its place ``{}``."""
    english, chinese = LABELS[name]
    if text is None:
        return Texts(english, chinese)
    return Texts(english.replace("{}", text.en), chinese.replace("{}", text.zh))


def phrase(name: str, **fields: Field) -> Texts:
    """Return the text of one phrase."""
    return rendered((Phrase(name, fields),))


def rendered(phrases: Phrases, otherwise: str = "") -> Texts:
    """Return the text of a message, which came from the bus, by its phrases or as it is."""
    english, chinese = (line(render(phrases, language, otherwise)) for language in LANGUAGES)
    return Texts(english, chinese)


def of_service(name: str) -> Texts:
    """Return the name of a service for people."""
    return Texts(*SERVICES.get(name, (name, name)))


def of_event(service: str, event: Event) -> Texts:
    """Return the text of an event, with what happened where its own text is only the reason."""
    text = rendered(event.phrases, event.text)
    if service == "safety" and event.name in LATCHES:
        return label("latched_event", text)
    return label(HAPPENED[event.name], text) if event.name in HAPPENED else text
