"""Catalogue of all texts on the page, in English and in Chinese; a test checks that it is complete.

Services publish their texts (a cause with its figures, an event, a refusal) in English, and in
English the page shows these. In Chinese it shows the entry of the cause's or event's name, and the
service's text below it.
"""

from pathlib import Path

import msgspec

FILE = Path(__file__).with_name("texts.toml")
LANGUAGES = ("en", "zh")
TEXTS = msgspec.toml.decode(FILE.read_bytes(), type=dict[str, tuple[str, str]])


def table() -> dict[str, dict[str, str]]:
    """Return the texts by language, as the page gets them."""
    return {
        language: {key: words[index] for key, words in TEXTS.items()}
        for index, language in enumerate(LANGUAGES)
    }
