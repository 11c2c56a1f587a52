"""Schemas that Foxglove's reader takes."""

from collections.abc import Iterator
from typing import Any

import msgspec
import pytest

from common.messages import Event, Health, Link, Message, SafetyState
from services.recorder import schema
from services.recorder.mcap_codec import KINDS

DRAWN = (schema.POSE, schema.ODOMETRY, schema.TRANSFORM, schema.SCAN, schema.LOG)
ALL = [schema.of_message(kind) for kind in KINDS.values()] + list(DRAWN)


def parts(table: dict[str, Any], inside: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield every schema within a schema, as the reader comes by them."""
    yield inside, table
    for name, part in table.get("properties", {}).items():
        yield from parts(part, f"{inside}.{name}")
    if "items" in table:
        yield from parts(table["items"], f"{inside}[]")


@pytest.mark.parametrize("one", ALL, ids=lambda one: one.name)
def test_nothing_in_it_that_the_reader_refuses(one: schema.Schema) -> None:
    whole = msgspec.json.decode(one.data)
    assert whole["type"] == "object"
    for where, part in parts(whole):
        assert part["type"] in ("object", "array", "string", "number", "integer", "boolean"), where
        assert not {"$ref", "anyOf", "oneOf", "enum", "$defs"} & part.keys(), where
        if part["type"] == "array":
            assert part["items"]["type"] != "array", where


@pytest.mark.parametrize("kind", [SafetyState, Link, Health, Event])
def test_every_field_is_in_it(kind: type[Message]) -> None:
    whole = msgspec.json.decode(schema.of_message(kind).data)
    assert list(whole["properties"]) == [field.name for field in msgspec.structs.fields(kind)]


def test_what_may_be_missing_is_said_to_be_what_it_is() -> None:
    whole = msgspec.json.decode(schema.of_message(Link).data)
    assert whole["properties"]["round_trip"] == {"type": "number"}
    assert whole["properties"]["state"] == {"type": "string"}


def test_drawn_ones_have_the_name_that_panels_look_for() -> None:
    assert {one.name for one in DRAWN} == {
        "foxglove.PoseInFrame", "foxglove.Odometry", "foxglove.FrameTransform",
        "foxglove.LaserScan", "foxglove.Log",
    }  # fmt: skip
