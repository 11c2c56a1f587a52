"""Views for Foxglove's 3D and log panels, derived from our messages, and JSON schemas. Pure.

Each sonar is a scan of its own in ``base_link``: a single LaserScan cannot represent ranges from
eight mounting positions. Frames and units follow REP-103 and REP-105: metres, radians.

Foxglove rejects a schema with ``$ref``, ``anyOf`` or ``null``, and recognises the messages of its
panels by the schema's name. An optional field has the type of its non-null value.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import msgspec

from common.freshness import NS_PER_S
from common.settings import Vehicle, sonar_mounts
from t2.messages import SONAR_NAMES, Event, MapPose, Message, Odometry, PlaneFrame, Ultrasonic

CONE = 0.5  # rad, for display only: the manual does not specify the sensors' opening angle
POINTS = 5  # of the displayed arc
LEVELS = {"info": 2, "warning": 3, "error": 4}


@dataclass(frozen=True, slots=True)
class Schema:
    """A named JSON schema."""

    name: str
    data: bytes


@cache
def schema_of(kind: type[Message]) -> Schema:
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

View = tuple[str, Schema, dict[str, Any]]  # topic, schema, message


class FoxgloveViews:
    """Derives the views for one vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._poses = [_pose(m.x, m.y, m.yaw) for m in sonar_mounts(vehicle)]

    def of(self, message: Message, service: str, log_ns: int) -> Iterator[View]:
        """Yield the views of a message, with the log time as their timestamp."""
        timestamp = {"sec": log_ns // NS_PER_S, "nsec": log_ns % NS_PER_S}
        match message:
            case Odometry():
                frames = message.frame_id, message.child_frame_id
                views = iter([_transform(*frames, message)])
            case MapPose(odom=PlaneFrame() as origin):
                views = iter([_transform(message.frame_id, "odom", origin)])
            case Ultrasonic():
                views = self._scans(message)
            case Event():
                views = iter([_log(message, service)])
            case _:
                views = iter(())
        for topic, kind, fields in views:
            yield f"foxglove/{topic}", kind, {"timestamp": timestamp, **fields}

    def _scans(self, message: Ultrasonic) -> Iterator[View]:
        for name, pose, distance in zip(SONAR_NAMES, self._poses, message.ranges, strict=True):
            fields = {
                "frame_id": "base_link",
                "pose": pose,
                "start_angle": -CONE / 2,
                "end_angle": CONE / 2,
                "ranges": [] if distance is None else [distance] * POINTS,
                "intensities": [],
            }
            yield f"sonar/{name}", SCAN, fields


def _transform(parent: str, child: str, at: Odometry | PlaneFrame) -> View:
    pose = _pose(at.x, at.y, at.heading)
    fields = {
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": pose["position"],
        "rotation": pose["orientation"],
    }
    return "tf", TRANSFORM, fields


def _log(message: Event, service: str) -> View:
    text = f"{message.name}: {message.text}"
    fields = {"level": LEVELS[message.level], "message": text, "name": service}
    return "log", LOG, {**fields, "file": "", "line": 0}


def _pose(x: float, y: float, heading: float) -> dict[str, dict[str, float]]:
    rotation = {"z": math.sin(heading / 2), "w": math.cos(heading / 2)}
    return {"position": {"x": x, "y": y, "z": 0.0}, "orientation": {"x": 0.0, "y": 0.0, **rotation}}
