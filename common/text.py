"""Texts from the bus: any member may write them, and terminals obey their escape sequences."""

import json

LONGEST = 1000  # characters of a line: escaping 80 events of 4000 takes 0.15 s


def printable(text: str, keep: str = "") -> str:
    """Return text, or JSON, with its control and formatting characters escaped except ``keep``."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in keep else json.dumps(c)[1:-1] for c in text)


def line(text: str) -> str:
    """Return a text of any length as one line of a screen, cut and escaped."""
    return printable(text[:LONGEST])[:LONGEST]
