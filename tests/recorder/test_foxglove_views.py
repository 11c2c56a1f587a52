"""Views for Foxglove's 3D and log panels, and schemas that Foxglove supports."""

import math
from collections.abc import Iterator
from typing import Any

import msgspec
import pytest

from common.settings import Vehicle
from services.recorder.foxglove_views import (
    LOG,
    SCAN,
    TRANSFORM,
    FoxgloveViews,
    Schema,
    schema_of,
)
from services.recorder.mcap_codec import MESSAGE_TYPES
from t2.messages import SONAR_NAMES, Event, Message, PlaneFrame
from tests import factories
from tests.recorder import samples

VEHICLE = Vehicle(length=1.0, width=0.6)
AT_NS = 1_700_000_000_250_000_000
VIEWS = (TRANSFORM, SCAN, LOG)
ALL = [schema_of(kind) for kind in MESSAGE_TYPES.values()] + list(VIEWS)


def views_of(message: Message, service: str = "") -> dict[str, tuple[Schema, dict[str, Any]]]:
    views = FoxgloveViews(VEHICLE).of(message, service, AT_NS)
    return {topic: (kind, fields) for topic, kind, fields in views}


@pytest.mark.parametrize(
    "message",
    [
        samples.odometry(),
        samples.ultrasonic(),
        factories.map_pose(),
        Event(name="stop", level="info", text="b"),
    ],
)
def test_views_match_their_schemas(message: Message) -> None:
    assert views_of(message)
    for kind, fields in views_of(message).values():
        assert fields.keys() == msgspec.json.decode(kind.data)["properties"].keys()
        assert fields["timestamp"] == {"sec": 1_700_000_000, "nsec": 250_000_000}


def test_the_frame_of_the_vehicle_follows_its_pose() -> None:
    _, transform = views_of(samples.odometry(x=3.0, heading=math.pi / 2))["foxglove/tf"]
    assert transform["translation"] == {"x": 3.0, "y": 2.0, "z": 0.0}
    half = math.sqrt(0.5)
    assert transform["rotation"] == pytest.approx({"x": 0.0, "y": 0.0, "z": half, "w": half})
    assert (transform["parent_frame_id"], transform["child_frame_id"]) == ("odom", "base_link")


def test_odom_follows_its_pose_in_the_map_once_it_is_known() -> None:
    origin = PlaneFrame(x=3.0, y=1.0, heading=math.pi)
    _, transform = views_of(factories.map_pose(odom=origin))["foxglove/tf"]
    assert transform["translation"] == {"x": 3.0, "y": 1.0, "z": 0.0}
    assert transform["rotation"] == pytest.approx({"x": 0.0, "y": 0.0, "z": 1.0, "w": 0.0})
    assert (transform["parent_frame_id"], transform["child_frame_id"]) == ("map", "odom")
    assert views_of(factories.map_pose("unplaced")) == {}


def test_each_sonar_is_a_scan_at_its_mounting_position() -> None:
    made = views_of(samples.ultrasonic())
    assert list(made) == [f"foxglove/sonar/{name}" for name in SONAR_NAMES]
    left = made["foxglove/sonar/left"][1]
    assert left["pose"]["position"] == {"x": 0.0, "y": 0.3, "z": 0.0}
    assert set(left["ranges"]) == {1.0}
    assert left["start_angle"] == -left["end_angle"] < 0
    assert made["foxglove/sonar/front_left"][1]["ranges"] == []


def parts(table: dict[str, Any], inside: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield every schema within a schema, depth first."""
    yield inside, table
    for name, part in table.get("properties", {}).items():
        yield from parts(part, f"{inside}.{name}")
    if "items" in table:
        yield from parts(table["items"], f"{inside}[]")


@pytest.mark.parametrize("one", ALL, ids=lambda one: one.name)
def test_schemas_use_only_what_foxglove_supports(one: Schema) -> None:
    whole = msgspec.json.decode(one.data)
    assert whole["type"] == "object"
    kind = MESSAGE_TYPES.get(one.name.removeprefix("t2.v1."))
    if kind is not None:
        assert list(whole["properties"]) == list(kind.__struct_fields__)
    for where, part in parts(whole):
        assert part["type"] in ("object", "array", "string", "number", "integer", "boolean"), where
        assert not {"$ref", "anyOf", "oneOf", "enum", "$defs"} & part.keys(), where
        if part["type"] == "array":
            assert part["items"]["type"] != "array", where
