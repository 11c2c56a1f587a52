"""JSON schemas for viewers: simplified schemas of our messages, and Foxglove's own. Pure.

Foxglove rejects a schema with ``$ref``, ``anyOf`` or ``null``, and recognises the messages of its
panels by the schema's name. An optional field has the type of its non-null value.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import msgspec

from common.messages import Message


@dataclass(frozen=True, slots=True)
class Schema:
    """A named JSON schema."""

    name: str
    data: bytes


@cache
def of_message(kind: type[Message]) -> Schema:
    """Return the simplified schema of a message type, ``t2.v1.Odometry``."""
    whole = msgspec.json.schema(kind)
    made = simplified(whole, whole.get("$defs", {}))
    return Schema(f"t2.v1.{kind.__name__}", msgspec.json.encode(made))


def simplified(schema: dict[str, Any], named: dict[str, Any]) -> dict[str, Any]:
    """Return a schema without references and alternatives; ``named`` holds the definitions."""
    if "$ref" in schema:
        return simplified(named[schema["$ref"].rpartition("/")[2]], named)
    if "anyOf" in schema:
        return simplified(next(s for s in schema["anyOf"] if s.get("type") != "null"), named)
    if "enum" in schema:  # all enums of ours are strings
        return {"type": "string"}
    made: dict[str, Any] = {"type": schema["type"]}
    if schema["type"] == "array":
        made["items"] = simplified(schema["items"], named)
    if schema["type"] == "object":
        parts = schema.get("properties", {})
        made["properties"] = {name: simplified(part, named) for name, part in parts.items()}
    if "description" in schema:
        made["description"] = schema["description"]
    return made


def _table(**properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "properties": properties}


def _foxglove(title: str, /, **properties: dict[str, Any]) -> Schema:
    whole = {"title": f"foxglove.{title}", **_table(timestamp=_TIME, **properties)}
    return Schema(f"foxglove.{title}", msgspec.json.encode(whole))


_NUMBER, _INTEGER, _TEXT = ({"type": kind} for kind in ("number", "integer", "string"))
_NUMBERS = {"type": "array", "items": _NUMBER}
_TIME = {"title": "time", **_table(sec=_INTEGER, nsec=_INTEGER)}
_VECTOR = _table(x=_NUMBER, y=_NUMBER, z=_NUMBER)
_QUATERNION = _table(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_POSE = _table(position=_VECTOR, orientation=_QUATERNION)

POSE = _foxglove("PoseInFrame", frame_id=_TEXT, pose=_POSE)
ODOMETRY = _foxglove(
    "Odometry",
    frame_id=_TEXT,
    child_frame_id=_TEXT,
    pose=_POSE,
    linear_velocity=_VECTOR,
    angular_velocity=_VECTOR,
    pose_covariance=_NUMBERS,
    velocity_covariance=_NUMBERS,
)
TRANSFORM = _foxglove(
    "FrameTransform",
    parent_frame_id=_TEXT,
    child_frame_id=_TEXT,
    translation=_VECTOR,
    rotation=_QUATERNION,
)
SCAN = _foxglove(
    "LaserScan",
    frame_id=_TEXT,
    pose=_POSE,
    start_angle=_NUMBER,
    end_angle=_NUMBER,
    ranges=_NUMBERS,
    intensities=_NUMBERS,
)
LOG = _foxglove("Log", level=_INTEGER, message=_TEXT, name=_TEXT, file=_TEXT, line=_INTEGER)
