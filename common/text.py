"""Texts from the bus: any member may write them, and terminals obey their escape sequences."""

import json


def printable(text: str, keep: str = "") -> str:
    """Return text, or JSON, with its control and formatting characters escaped except ``keep``."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in keep else json.dumps(c)[1:-1] for c in text)
