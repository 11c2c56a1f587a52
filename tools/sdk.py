"""The generated modules of the client library ``sdk/``: messages with their keys, and client."""

import ast
from pathlib import Path
from types import ModuleType

from common import client, keys, messages

SDK = Path(__file__).parent.parent / "sdk" / "t2"
HEAD = '''"""Messages and keys; generated from the stack's own by ``make docs``, do not edit.

Frozen structs, SI units and radians, ``None`` for unknown. Frames follow REP-103 and REP-105: x
forward, y left, counter-clockwise positive. Readers ignore unknown fields.
"""

from typing import Annotated, Literal

from msgspec import Meta, Struct

Command = Literal["run", "stop", "brake"]
'''
CLIENT_HEAD = '''"""Client of safety; generated from ``common/client.py``, do not edit."""

from enum import Enum

from msgspec import Struct

from t2.messages import Drive, ReleaseRequest, ResetDone, ResetRequest, SafetyState

'''


def generated() -> dict[Path, str]:
    """Return the text of each generated module."""
    return {
        SDK / "messages.py": f"{HEAD}\n{_body(messages)}{_keys()}",
        SDK / "client.py": CLIENT_HEAD + _body(client),
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


def _keys() -> str:
    rows = [
        f'    "{name.lower()}": ("{topic.path}", {topic.message.__name__}),\n'
        for name, topic in vars(keys).items()
        if isinstance(topic, keys.Topic)
    ]
    return (
        f'\n\n# --- keys {"-" * 83}\n\nROOT = "{keys.ROOT}"\n\n'
        "# By name: the path below the robot, and the type of the message.\n"
        "TOPICS: dict[str, tuple[str, type[Message]]] = {\n" + "".join(rows) + "}\n"
    )
