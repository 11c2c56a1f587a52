"""Catalogue of all texts on the page, in English and in Chinese; a test checks that it is complete.

Services publish their texts (a cause with its figures, an event, a refusal) in English, and in
English the page shows these. In Chinese it shows the entry of the cause's or event's name, and
below it the service's text by the sentences of ``phrases.toml``.
"""

from pathlib import Path

import msgspec

FILE = Path(__file__).with_name("texts.toml")
LANGUAGES = ("en", "zh")
PHRASES_FILE = Path(__file__).with_name("phrases.toml")
PLACEHOLDER = "{}"
TEXTS = msgspec.toml.decode(FILE.read_bytes(), type=dict[str, tuple[str, str]])
PHRASES = msgspec.toml.decode(PHRASES_FILE.read_bytes(), type=dict[str, str])


def table() -> dict[str, dict[str, str]]:
    """Return the texts by language, as the page gets them."""
    return {
        language: {key: words[index] for key, words in TEXTS.items()}
        for index, language in enumerate(LANGUAGES)
    }


def phrases() -> dict[str, str]:
    """Return the services' English sentences with their Chinese; causes are in ``TEXTS``."""
    causes = dict(words for key, words in TEXTS.items() if key.startswith("cause."))
    return causes | PHRASES
