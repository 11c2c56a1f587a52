"""Markdown pages with generated blocks, each between ``<!-- name -->`` and ``<!-- end -->``."""

from collections.abc import Mapping


def filled(text: str, blocks: Mapping[str, str]) -> str:
    """Return the page with its blocks made anew."""
    for name, block in blocks.items():
        begin = text.index(f"<!-- {name} -->\n") + len(f"<!-- {name} -->\n")
        end = text.index("<!-- end -->", begin)
        text = f"{text[:begin]}{block}\n{text[end:]}"
    return text
