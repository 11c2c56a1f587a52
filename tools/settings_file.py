"""``config/t2.toml``: every setting with its default, unit, range and meaning, from the code.

The lines are comments: the defaults have one home, the sections in ``config.py`` of each service.
"""

import json
from collections.abc import Iterator
from enum import Enum
from typing import Any, get_type_hints

import msgspec
from msgspec import Struct

from cli.settings import Everything
from common import settings
from common.config import flatten, type_info
from common.settings import extra_of
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
    types = get_type_hints(kind, include_extras=True)
    why = _comments(kind)
    tables = []
    if path:
        yield f"\n[{path}] # {(kind.__doc__ or '').splitlines()[0]}\n"
    for field in msgspec.structs.fields(kind):
        at, value = f"{path}.{field.name}".lstrip("."), getattr(section, field.name)
        if isinstance(value, (Struct, dict)):
            tables.append((at, value, why.get(field.name, "")))
            continue
        meaning = "; ".join(filter(None, (_range(types[field.name]), why.get(field.name))))
        yield f"# {field.name} = {_toml(value)}{f' # {meaning}' if meaning else ''}\n"
    for at, table, meaning in tables:
        if isinstance(table, Struct):
            yield from _section(at, table)
        else:
            yield f"\n# [{at}]{f' # {meaning}' if meaning else ''}\n"
            yield from (f"# {name} = {_row(row)}\n" for name, row in table.items())


def _comments(kind: type[Struct]) -> dict[str, str]:
    """Return the comment of each field: that of its line, or the lines above it."""
    sections = [
        base
        for base in reversed(kind.__mro__)
        if issubclass(base, (settings.Section, settings.Shared))
    ]
    return {field.name: field.why.strip(" .") for base in sections for field in fields_of(base)}


def _range(kind: Any) -> str:
    """Return the allowed values of a field, without ``unsafe_overrides``, and their unit."""
    info, extra = type_info(kind), extra_of(kind)
    if item := getattr(info, "item_type", None):
        return str((getattr(item, "extra", None) or {}).get("unit", ""))
    if words := getattr(info, "values", ()):
        return ", ".join(json.dumps(word) for word in words)
    low: float | None = getattr(info, "ge", None)
    high: float | None = getattr(info, "le", None)
    if (safe := extra.get("safe")) and not isinstance(safe.low, bool):
        low, high = safe.low or low, safe.high
    if high is None:
        return str(extra.get("unit", ""))
    if high == 0.0:
        return "0 without unsafe_overrides"
    over: float | None = getattr(info, "gt", None)
    least = f"over {over or 0:g}, up to" if low is None else f"{low:g} to"
    return f"{least} {high:g} {extra.get('unit', '')}".rstrip()


def _row(row: Struct) -> str:
    return "{ " + ", ".join(f"{name} = {_toml(value)}" for name, value in flatten(row)) + " }"


def _toml(value: Any) -> str:
    """Return a value as TOML."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(_toml, value))}]"
    return json.dumps(value.value if isinstance(value, Enum) else value)
