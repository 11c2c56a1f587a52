"""The page and its files, read once: a request reads no disk and can name no other file."""

import json
from pathlib import Path
from string import Template

from services.dashboard.i18n import table

STATIC = Path(__file__).parent / "static"
TYPES = {".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}


def page(robot: str) -> str:
    """Return the page that opens with this robot."""
    texts = json.dumps(table(), ensure_ascii=False).replace("<", "\\u003c")
    template = Template((STATIC / "index.html").read_text(encoding="utf-8"))
    return template.substitute(robot=robot, texts=texts)


def files() -> dict[str, tuple[bytes, str]]:
    """Return the content and the media type of each file that the page loads, by name."""
    return {
        path.name: (path.read_bytes(), TYPES[path.suffix])
        for path in STATIC.iterdir()
        if path.suffix in TYPES
    }
