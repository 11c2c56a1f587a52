"""Catalogue of all texts on the page, in English and in Chinese; a test checks that it is complete.

Services publish their texts (a cause with its figures, an event, a refusal) in English, and in
English the page shows these. In Chinese it shows the entry of the cause's or event's name, and
below it the service's text by the sentences of ``phrases.toml``.
"""

from pathlib import Path

import msgspec

FILE = Path(__file__).with_name("texts.toml")
PHRASES_FILE = Path(__file__).with_name("phrases.toml")
CATALOGUE = msgspec.toml.decode(FILE.read_bytes(), type=dict[str, tuple[str, str] | str])
EVENTS = {key: words for key, words in CATALOGUE.items() if isinstance(words, str)}  # Chinese
TEXTS = {key: words for key, words in CATALOGUE.items() if not isinstance(words, str)}
PHRASES = msgspec.toml.decode(PHRASES_FILE.read_bytes(), type=dict[str, str])


def table() -> dict[str, dict[str, str]]:
    """Return the texts by language, as the page gets them."""
    english, chinese = ({key: words[at] for key, words in TEXTS.items()} for at in (0, 1))
    return {"en": english, "zh": chinese | EVENTS}


def phrases() -> dict[str, str]:
    """Return the services' English sentences with their Chinese; causes are in ``TEXTS``."""
    causes = dict(words for key, words in TEXTS.items() if key.startswith("cause."))
    return causes | PHRASES
