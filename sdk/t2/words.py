"""Texts for people: phrases of the catalogue, in English or Chinese. Pure.

A cause, an event or a refusal is a name with fields, so that each screen shows it in the language
of its reader. A template has a placeholder for each field: ``{name}``, with an optional format of
Python's, as in ``{age:.1f}``. ``{name:word}`` is a word of the catalogue, or several.
``{name:service}`` is the name of a service, for its commands too: ``里程计（odom）`` in Chinese.
``{name:source}`` is that of a source of requests: ``web (page)``.
``{name:operator}`` is the name of an operator, or ``viewer 3`` for one without a name.
"""

import re
from collections.abc import Iterable, Mapping
from typing import Literal, get_args

from t2.catalogue import SERVICES, SOURCES, TEXTS, WORDS
from t2.messages import Done, Field, Phrase, Refusal
from t2.patrol_texts import Words

Language = Literal["en", "zh"]
LANGUAGES: tuple[Language, ...] = get_args(Language)
VIEWER = re.compile(r"viewer (\d+)")
PLACEHOLDER = re.compile(r"\{(\w+)(?::([^}]*))?\}")
GAP = {"en": " ", "zh": ""}  # between two sentences
COMMA = {"en": ", ", "zh": "、"}  # between two words of a list


def render(
    phrases: Iterable[Phrase],
    language: Language = "en",
    otherwise: str = "",
    texts: Mapping[str, Words] = TEXTS,
) -> str:
    """Return the phrases as one text.

    ``otherwise`` is the text of the message that has them: it is returned without any phrase, and
    for one that this version does not know. ``texts`` has the templates by name.
    """
    rendered = [_rendered(phrase, language, texts) for phrase in phrases]
    if not rendered or None in rendered:
        return otherwise
    return GAP[language].join(filter(None, rendered))


def done(*phrases: Phrase, boot: int = 0) -> Done:
    """Return the answer to a call that was carried out."""
    return Done(text=render(phrases), phrases=phrases, boot=boot)


def refusal(*reasons: Phrase) -> Refusal:
    """Return the error reply to a call that was not carried out."""
    return Refusal(text=render(reasons), phrases=reasons)


def in_language(words: Words, language: Language) -> str:
    """Return a pair of texts in one language."""
    return words[LANGUAGES.index(language)]


def _rendered(phrase: Phrase, language: Language, texts: Mapping[str, Words]) -> str | None:
    words = texts.get(phrase.name)
    if words is None:
        return None

    def value(found: "re.Match[str]") -> str:
        return _value(phrase.fields.get(found[1]), found[2] or "", language)

    return PLACEHOLDER.sub(value, in_language(words, language))


def _value(value: Field, form: str, language: Language) -> str:
    if isinstance(value, tuple):
        return COMMA[language].join(_value(each, form, language) for each in value)
    if form == "word":
        words = WORDS.get(str(value))
        return in_language(words, language) if words else str(value).replace("_", " ")
    if form == "service":
        is_known = language == "zh" and value in SERVICES
        return f"{SERVICES[str(value)][1]}（{value}）" if is_known else str(value)
    if form == "source":
        words = SOURCES.get(str(value))
        return in_language(words, language) if words else str(value)
    if form == "operator":
        found = VIEWER.fullmatch(str(value))
        return f"{in_language(WORDS['viewer'], language)} {found[1]}" if found else str(value)
    return format(value, form) if form and isinstance(value, float | int) else str(value)
