"""The shipped hashes, computed anew by rosbags and by hand from the table of interfaces."""

import hashlib
import json
from typing import Any

import pytest

from services.ros2.definitions import FIELDS
from services.ros2.rihs import HASHES
from tests.ros2 import oracle

TYPE_IDS = {
    "uint8": 3, "char": 3, "int32": 6, "uint32": 7, "float32": 10, "float64": 11,
    "bool": 15, "byte": 16, "string": 17,
}  # fmt: skip
NESTED, ARRAY, UNBOUNDED = 1, 48, 144


@pytest.mark.parametrize("name", [name for name in sorted(HASHES) if "/msg/" in name])
def test_a_hash_is_that_of_every_distribution(name: str) -> None:
    for store in oracle.STORES:
        assert store.hash_rihs01(name) == HASHES[name]


@pytest.mark.parametrize("name", sorted(HASHES))
def test_a_hash_follows_from_the_table(name: str) -> None:
    assert hash_of(name) == HASHES[name]


def hash_of(name: str) -> str:
    """Return the RIHS01 hash of an interface, after the rules of REP 2016."""
    table = {**FIELDS, **service(name)} if "/srv/" in name else FIELDS
    needed = sorted(referenced(name, table) - {name})
    description = {
        "type_description": described(name, table),
        "referenced_type_descriptions": [described(each, table) for each in needed],
    }
    return "RIHS01_" + hashlib.sha256(json.dumps(description).encode()).hexdigest()


def service(name: str) -> dict[str, tuple[tuple[str, str], ...]]:
    """Return the fields of a service as a type, and of its event."""
    request, response = f"{name}_Request", f"{name}_Response"
    return {
        name: (
            ("request_message", request),
            ("response_message", response),
            ("event_message", f"{name}_Event"),
        ),
        f"{name}_Event": (
            ("info", "service_msgs/msg/ServiceEventInfo"),
            ("request", f"{request}[<1]"),
            ("response", f"{response}[<1]"),
        ),
        request: FIELDS[request] or (("structure_needs_at_least_one_member", "uint8"),),
        "service_msgs/msg/ServiceEventInfo": (
            ("event_type", "uint8"),
            ("stamp", "builtin_interfaces/msg/Time"),
            ("client_gid", "char[16]"),
            ("sequence_number", "int64"),
        ),
    }


def referenced(name: str, table: dict[str, Any]) -> set[str]:
    """Return the types that a type consists of."""
    kinds = [kind.partition("[")[0] for _, kind in table[name]]
    return set().union({name}, *(referenced(kind, table) for kind in kinds if "/" in kind))


def described(name: str, table: dict[str, Any]) -> dict[str, object]:
    """Return the description of one type."""
    return {
        "type_name": name,
        "fields": [{"name": field, "type": typed(kind)} for field, kind in table[name]],
    }


def typed(kind: str) -> dict[str, object]:
    """Return the description of a field's type."""
    item, bracket, rest = kind.partition("[")
    size = rest.removesuffix("]")
    ids = {**TYPE_IDS, "int64": 8}
    number = ids.get(item, NESTED)
    if bracket and size.startswith("<"):
        number, capacity = number + 96, int(size[1:])
    elif bracket and size:
        number, capacity = number + ARRAY, int(size)
    else:
        number, capacity = number + (UNBOUNDED if bracket else 0), 0
    return {
        "type_id": number,
        "capacity": capacity,
        "string_capacity": 0,
        "nested_type_name": item if "/" in item else "",
    }
