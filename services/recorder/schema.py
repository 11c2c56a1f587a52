"""JSON schemas that viewers can read: ours made plain, and those of Foxglove that we draw with.

Foxglove's reader refuses a schema with ``$ref``, ``anyOf`` or a ``null``, and knows a message that
it can draw by the schema's name. What may be null is said to be what it is when it is there.
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
    """Return the plain schema of one of our messages, ``t2.v1.Odometry``."""
    whole = msgspec.json.schema(kind)
    made = plain(whole, whole.get("$defs", {}))
    return Schema(f"t2.v1.{kind.__name__}", msgspec.json.encode(made))


def plain(schema: dict[str, Any], named: dict[str, Any]) -> dict[str, Any]:
    """Return a schema without references and alternatives; ``named`` is what it refers to."""
    if "$ref" in schema:
        return plain(named[schema["$ref"].rpartition("/")[2]], named)
    if "anyOf" in schema:
        return plain(next(s for s in schema["anyOf"] if s.get("type") != "null"), named)
    if "enum" in schema:  # all of ours are of words
        return {"type": "string"}
    made: dict[str, Any] = {"type": schema["type"]}
    if schema["type"] == "array":
        made["items"] = plain(schema["items"], named)
    if schema["type"] == "object":
        parts = schema.get("properties", {})
        made["properties"] = {name: plain(part, named) for name, part in parts.items()}
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
