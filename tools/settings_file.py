"""``config/t2.toml``: every setting with its default, unit, range and meaning, from the code.

The lines are comments: the defaults have one home, the sections in ``config.py`` of each service.
"""

import json
from collections.abc import Iterator
from enum import Enum
from typing import Any

import msgspec
from msgspec import Struct

from cli.settings import Everything
from common import settings
from common.config import flatten
from tools.fields import fields_of

HEAD = """\
# T2's settings and their defaults. To change one, remove the `#` before it, or name it in a file of
# your own (--config FILE, or T2_CONFIG), in the environment (T2__BOARD__PORT=4002) or in
# --set board.port=4002; the later one wins. `t2 config` shows the effective settings and their
# sources.
# Generated from the code by `make docs`.
"""


def text() -> str:
    """Return the file."""
    return "".join([HEAD, *_section("", Everything())])


def _section(path: str, section: Struct) -> Iterator[str]:
    """Yield the lines of a section, then those of its tables."""
    kind = type(section)
    info: Any = msgspec.inspect.type_info(kind)
    why, protective = _comments(kind), getattr(kind, "protective", {})
    tables = []
    if path:
        yield f"\n[{path}] # {(kind.__doc__ or '').splitlines()[0]}\n"
    for field in info.fields:
        at, value = f"{path}.{field.name}".lstrip("."), getattr(section, field.name)
        if isinstance(value, (Struct, dict)):
            tables.append((at, value, why.get(field.name, "")))
            continue
        limits = _range(field.type, protective.get(field.name))
        meaning = "; ".join(filter(None, (why.get(field.name), limits)))
        yield f"# {field.name} = {_toml(value)}{f' # {meaning}' if meaning else ''}\n"
    for at, table, meaning in tables:
        if isinstance(table, Struct):
            yield from _section(at, table)
        else:
            yield f"\n# [{at}]{f' # {meaning}' if meaning else ''}\n"
            yield from (f"# {name} = {_row(row)}\n" for name, row in table.items())


def _comments(kind: type[Struct]) -> dict[str, str]:
    """Return the comment of each field: that of its line, or the lines above it."""
    sections = [base for base in reversed(kind.__mro__) if issubclass(base, settings.Section)]
    return {field.name: field.why.strip(" .") for base in sections for field in fields_of(base)}


def _range(kind: Any, protective: tuple[float, float] | None) -> str:
    """Return the allowed values of a field, without ``unsafe_overrides``."""
    words = getattr(kind, "values", ())
    if words:
        return ", ".join(json.dumps(word) for word in words)
    low: float | None = getattr(kind, "ge", None)
    high: float | None = getattr(kind, "le", None)
    over: float | None = getattr(kind, "gt", None)
    if protective and not isinstance(protective[0], bool):
        low = max(protective[0], low or 0.0) or None
        high = protective[1] if high is None else min(protective[1], high)
    if high is None:
        return ""
    if high == 0.0:
        return "0 without unsafe_overrides"
    return f"{low:g} to {high:g}" if low is not None else f"over {over or 0:g}, up to {high:g}"


def _row(row: Struct) -> str:
    return "{ " + ", ".join(f"{name} = {_toml(value)}" for name, value in flatten(row)) + " }"


def _toml(value: Any) -> str:
    """Return a value as TOML."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(_toml, value))}]"
    return json.dumps(value.value if isinstance(value, Enum) else value)
