"""The generated modules of the client library ``sdk/``: messages with their keys, and client."""

import ast
import re
import textwrap
from pathlib import Path
from types import ModuleType

from common import client, keys, messages, text_file
from services.safety.core.causes import RULES

ROOT = Path(__file__).parent.parent
SDK = ROOT / "sdk" / "t2"
EVENTS = re.compile(r"^\| [\w, ]+ \| (`.*`) \| (?:info|warning|error)", re.MULTILINE)
HEAD = '''"""Messages and keys; generated from the stack's own by ``make docs``, do not edit.

Frozen structs, SI units and radians, ``None`` for unknown. Frames follow REP-103 and REP-105: x
forward, y left, counter-clockwise positive. Readers ignore unknown fields.
"""

from typing import TYPE_CHECKING, Annotated, Literal

from msgspec import Meta, Struct

Command = Literal["run", "stop", "brake"]
'''
CLIENT_HEAD = '''"""Client of safety; generated from ``common/client.py``, do not edit."""

from enum import Enum

from msgspec import Struct

from t2.messages import Drive, ReleaseRequest, ResetDone, ResetRequest, SafetyState

'''
TEXT_HEAD = '''"""Files that people wrote; generated from ``common/text_file.py``, do not edit."""

import codecs
import re
import unicodedata
from pathlib import Path

'''


def generated() -> dict[Path, str]:
    """Return the text of each generated module."""
    return {
        SDK / "messages.py": f"{HEAD}\n{_named(_body(messages))}{_keys()}",
        SDK / "client.py": CLIENT_HEAD + _body(client),
        SDK / "text_file.py": TEXT_HEAD + _body(text_file),
    }


def _body(module: ModuleType) -> str:
    """Return a module without its docstring and its imports."""
    text = Path(str(module.__file__)).read_text("utf-8")
    lines = text.splitlines(keepends=True)
    for node in reversed(ast.parse(text).body):
        is_docstring = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if is_docstring or isinstance(node, ast.Import | ast.ImportFrom):
            del lines[node.lineno - 1 : node.end_lineno]
    return "".join(lines).strip("\n") + "\n"


def _named(body: str) -> str:
    """Return the messages with the names of causes and events, for type checkers only.

    A message with a name of a later version is decoded all the same.
    """
    page = (ROOT / "docs" / "operations.md").read_text("utf-8")
    events = {name for cell in EVENTS.findall(page) for name in re.findall(r"\w+", cell)}
    for kind, names in (("Cause", [rule.name for rule in RULES]), ("Event", sorted(events))):
        plain = f"{kind}Name = Name"
        quoted = textwrap.indent(textwrap.fill(" ".join(f'"{it}",' for it in names), 91), " " * 8)
        typed = f"    {kind}Name = Literal[\n{quoted}\n    ]  # fmt: skip\n"
        body = body.replace(plain, f"if TYPE_CHECKING:\n{typed}else:\n    {plain}")
    return body


def _keys() -> str:
    rows = [
        f'    "{name.lower()}": ("{topic.path}", {topic.message.__name__}),\n'
        for name, topic in vars(keys).items()
        if isinstance(topic, keys.Topic)
    ]
    return (
        f'\n\n# --- keys {"-" * 83}\n\nROOT = "{keys.ROOT}"\n\n'
        f"# The services that make a robot.\nON_BOARD = {keys.ON_BOARD!r}\n\n".replace("'", '"')
        + "# By name: the path below the robot, and the type of the message.\n"
        "TOPICS: dict[str, tuple[str, type[Message]]] = {\n" + "".join(rows) + "}\n"
    )
