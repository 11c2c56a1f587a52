"""Structure-aware mutation: valid MessagePack with one to three invalid values.

msgspec decodes in C, where libFuzzer has no coverage: without this module it keeps two inputs only.
"""

import math
from collections.abc import Sequence
from copy import deepcopy
from random import Random
from typing import Any

import msgpack

HOSTILE: tuple[Any, ...] = (
    None, True, -1, 0, 2**63, 2**64 - 1, -(2**63), 0.5, math.nan, math.inf, -math.inf, 5e-324,
    "", "run", "\x00", "近" * 40, b"", b"\xff", [], {}, [None] * 9, {"": {}}, {1: 2},
    msgpack.ExtType(5, b"x"), msgpack.Timestamp(1, 2), [[[[[]]]]],
)  # fmt: skip


def mutated(known: Sequence[bytes], random: Random) -> bytes:
    """Return a known input with one to three changed values."""
    raw = random.choice(known)
    try:
        value = msgpack.unpackb(raw[1:], strict_map_key=False)
    except (ValueError, msgpack.UnpackException):
        return raw
    for _ in range(random.randint(1, 3)):
        value = _damaged(value, random)
    packed: bytes = msgpack.packb(value)
    return raw[:1] + packed


def _damaged(value: Any, random: Random) -> Any:
    """Replace, remove or add a value at a random place."""
    if not isinstance(value, dict | list) or not value or random.random() < 0.2:
        return _hostile(random)
    keys = list(value) if isinstance(value, dict) else list(range(len(value)))
    key = random.choice(keys)
    what = random.random()
    if what < 0.1:
        del value[key]
    elif what < 0.2 and isinstance(value, dict):
        value[random.choice(("", "seq", "later", "近"))] = _hostile(random)
    elif what < 0.2 and isinstance(value, list):
        value.insert(key, _hostile(random))
    else:
        value[key] = _damaged(value[key], random)
    return value


def _hostile(random: Random) -> Any:
    return deepcopy(random.choice(HOSTILE))  # a later change may be inside it
