"""Schemas that Foxglove supports."""

from collections.abc import Iterator
from typing import Any

import msgspec
import pytest

from common.messages import Event, Health, Link, Message, SafetyState
from services.recorder import schema
from services.recorder.mcap_codec import MESSAGE_TYPES

VIEWS = (schema.POSE, schema.ODOMETRY, schema.TRANSFORM, schema.SCAN, schema.LOG)
ALL = [schema.of_message(kind) for kind in MESSAGE_TYPES.values()] + list(VIEWS)


def parts(table: dict[str, Any], inside: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield every schema within a schema, depth first."""
    yield inside, table
    for name, part in table.get("properties", {}).items():
        yield from parts(part, f"{inside}.{name}")
    if "items" in table:
        yield from parts(table["items"], f"{inside}[]")


@pytest.mark.parametrize("one", ALL, ids=lambda one: one.name)
def test_schemas_use_only_what_foxglove_supports(one: schema.Schema) -> None:
    whole = msgspec.json.decode(one.data)
    assert whole["type"] == "object"
    for where, part in parts(whole):
        assert part["type"] in ("object", "array", "string", "number", "integer", "boolean"), where
        assert not {"$ref", "anyOf", "oneOf", "enum", "$defs"} & part.keys(), where
        if part["type"] == "array":
            assert part["items"]["type"] != "array", where


@pytest.mark.parametrize("kind", [SafetyState, Link, Health, Event])
def test_schemas_contain_every_field(kind: type[Message]) -> None:
    whole = msgspec.json.decode(schema.of_message(kind).data)
    assert list(whole["properties"]) == [field.name for field in msgspec.structs.fields(kind)]


def test_optional_fields_have_their_non_null_type() -> None:
    whole = msgspec.json.decode(schema.of_message(Link).data)
    assert whole["properties"]["round_trip"] == {"type": "number"}
    assert whole["properties"]["state"] == {"type": "string"}


def test_views_have_foxglove_schema_names() -> None:
    assert {one.name for one in VIEWS} == {
        "foxglove.PoseInFrame", "foxglove.Odometry", "foxglove.FrameTransform",
        "foxglove.LaserScan", "foxglove.Log",
    }  # fmt: skip
