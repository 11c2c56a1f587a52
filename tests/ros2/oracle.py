"""An independent implementation of ROS messages: the package rosbags."""

from collections.abc import Iterator
from typing import Any

from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from services.ros2.cdr import Value
from services.ros2.definitions import FIELDS

STORE = get_typestore(Stores.ROS2_JAZZY)


def as_message(name: str) -> str:
    """Return the name by which rosbags knows a type: it has no services."""
    return name.replace("/srv/", "/msg/")


for service, fields in FIELDS.items():
    if "/srv/" in service:
        text = "\n".join(f"{kind} {field}" for field, kind in fields)
        STORE.register(get_types_from_msg(text or "uint8 no_member", as_message(service)))
DISTRIBUTIONS = (Stores.ROS2_IRON, Stores.ROS2_JAZZY, Stores.ROS2_KILTED, Stores.ROS2_LYRICAL)
STORES = [get_typestore(distribution) for distribution in DISTRIBUTIONS]

TEXT = st.characters(exclude_categories=["Cs"], exclude_characters="\0")
FINITE = {"float32": st.floats(width=32, allow_nan=False), "float64": st.floats(allow_nan=False)}
PRIMITIVES: dict[str, st.SearchStrategy[Any]] = {
    "bool": st.booleans(),
    "byte": st.integers(0, 127),  # rosbags reads it as signed
    "uint8": st.integers(0, 255),
    "int32": st.integers(-(2**31), 2**31 - 1),
    "uint32": st.integers(0, 2**32 - 1),
    "int64": st.integers(-(2**63), 2**63 - 1),
    "uint64": st.integers(0, 2**64 - 1),
    "string": st.text(TEXT, max_size=30),
    **FINITE,
}


def values(name: str) -> st.SearchStrategy[Value]:
    """Return a strategy for messages of a type, in the form of ``cdr``."""
    item, bracket, rest = name.partition("[")
    if bracket:
        size = int(rest[:-1].removeprefix("<=1") or 0)
        low, high = (size, size) if size else (0, 1 if "<=" in rest else 4)
        return st.lists(values(item), min_size=low, max_size=high).map(tuple)
    if item in PRIMITIVES:
        return PRIMITIVES[item]
    return st.tuples(*[values(kind) for _, kind in FIELDS[item]])


def as_rosbags(name: str, value: Value) -> Any:
    """Return a message of rosbags for a value in the form of ``cdr``."""
    item, bracket, _ = name.partition("[")
    if bracket:
        return _array(item, value)
    if item in PRIMITIVES:
        return value
    made = STORE.types[as_message(item)]
    parts = zip(FIELDS[item], value, strict=True)
    return made(**{field: as_rosbags(kind, part) for (field, kind), part in parts})


def _array(item: str, value: Value) -> Any:
    import numpy

    if item in PRIMITIVES and item != "string":
        return numpy.array(value, dtype=item)
    return [as_rosbags(item, part) for part in value]


def message_types() -> Iterator[str]:
    """Yield the types whose fields rosbags knows, too."""
    yield from (name for name in FIELDS if as_message(name) in STORE.types and FIELDS[name])
