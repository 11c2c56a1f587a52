"""Type hashes: of messages by rosbags, of services by the rules of ROS (REP-2016)."""

import hashlib
import json
from collections.abc import Mapping
from typing import Any

import pytest

from services.ros2.definitions import FIELDS, HASHES, Fields
from tests.ros2 import oracle

KINDS = {
    "uint8": 3, "int32": 6, "uint32": 7, "int64": 8, "uint64": 9, "float32": 10, "float64": 11,
    "bool": 15, "byte": 16, "string": 17,
}  # fmt: skip
EMPTY: Fields = (("structure_needs_at_least_one_member", "uint8"),)
INFO: Fields = (
    ("event_type", "uint8"),
    ("stamp", "builtin_interfaces/msg/Time"),
    ("client_gid", "uint8[16]"),
    ("sequence_number", "int64"),
)


def as_described(kind: str) -> dict[str, object]:
    """Return the description of a field's type."""
    item, bracket, rest = kind.partition("[")
    bound = rest.rstrip("]")
    size = int(bound.removeprefix("<=") or 0)
    of_array = 0 if not bracket else 96 if "<=" in bound else 48 if bound else 144
    return {
        "type_id": of_array + KINDS.get(item, 1),
        "capacity": size,
        "string_capacity": 0,
        "nested_type_name": "" if item in KINDS else item,
    }


def type_hash(name: str, known: Mapping[str, Fields]) -> str:
    """Return the hash of a type's description with those of all types in it."""
    found: dict[str, Any] = {}

    def describe(each: str) -> None:
        fields = [{"name": field, "type": as_described(kind)} for field, kind in known[each]]
        found[each] = {"type_name": each, "fields": fields}
        for _, kind in known[each]:
            item = kind.partition("[")[0]
            if item not in KINDS and item not in found:
                describe(item)

    describe(name)
    own = found.pop(name)
    others = [found[each] for each in sorted(found)]
    text = json.dumps({"type_description": own, "referenced_type_descriptions": others})
    return f"RIHS01_{hashlib.sha256(text.encode()).hexdigest()}"


def of_service(name: str) -> dict[str, Fields]:
    """Return the types of a service: its two messages, and the event that both are in."""
    sent, event = {part: f"{name}_{part}" for part in ("Request", "Response")}, f"{name}_Event"
    return {
        "service_msgs/msg/ServiceEventInfo": INFO,
        **{each: FIELDS[each] or EMPTY for each in sent.values()},
        event: (
            ("info", "service_msgs/msg/ServiceEventInfo"),
            *((part.lower(), f"{each}[<=1]") for part, each in sent.items()),
        ),
        name: (
            *((f"{part.lower()}_message", each) for part, each in sent.items()),
            ("event_message", event),
        ),
    }


@pytest.mark.parametrize("name", [name for name in HASHES if "/msg/" in name])
def test_a_hash_is_that_of_every_distribution(name: str) -> None:
    assert type_hash(name, FIELDS) == HASHES[name]
    for store in oracle.STORES:
        assert store.hash_rihs01(name) == HASHES[name]


@pytest.mark.parametrize("name", [name for name in HASHES if "/srv/" in name])
def test_a_hash_of_a_service_follows_from_its_fields(name: str) -> None:
    """That of Trigger was captured from a real ROS."""
    assert type_hash(name, {**FIELDS, **of_service(name)}) == HASHES[name]
