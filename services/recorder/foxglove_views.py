"""Views for Foxglove's 3D and log panels, derived from our messages. Pure.

Each sonar is a scan of its own in ``base_link``: a single LaserScan cannot represent ranges from
eight mounting positions. Frames and units follow REP-103 and REP-105: metres, radians.
"""

import math
from collections.abc import Iterator
from typing import Any

from common.codec import finite
from common.freshness import NS_PER_S
from common.messages import SONAR_NAMES, Event, Message, Odometry, Ultrasonic
from common.settings import Vehicle, sonar_mounts
from services.recorder import schema
from services.recorder.schema import Schema

CONE = 0.5  # rad, for display only: the manual does not specify the sensors' opening angle
POINTS = 5  # of the displayed arc
LEVELS = {"info": 2, "warning": 3, "error": 4}

View = tuple[str, Schema, dict[str, Any]]  # topic, schema, message


class FoxgloveViews:
    """Derives the views for one vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._poses = [_pose(m.x, m.y, m.yaw) for m in sonar_mounts(vehicle)]

    def of(self, message: Message, service: str, log_ns: int) -> Iterator[View]:
        """Yield the views of a message, with the log time as their timestamp."""
        timestamp = {"sec": log_ns // NS_PER_S, "nsec": log_ns % NS_PER_S}
        match message:
            case Odometry() if finite(message.x, message.y, message.heading):
                views = _odometry(message)
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
            yield f"sonar/{name}", schema.SCAN, fields


def _odometry(message: Odometry) -> Iterator[View]:
    pose = _pose(message.x, message.y, message.heading)
    parent, child = message.frame_id, message.child_frame_id
    yield "pose", schema.POSE, {"frame_id": parent, "pose": pose}
    transform = {
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": pose["position"],
        "rotation": pose["orientation"],
    }
    yield "tf", schema.TRANSFORM, transform
    fields = {
        "frame_id": parent,
        "child_frame_id": child,
        "pose": pose,
        "linear_velocity": _vector(x=message.linear),
        "angular_velocity": _vector(z=message.angular),
        "pose_covariance": _expanded(message.pose_covariance, (0, 1, 5)),
        "velocity_covariance": _expanded(message.twist_covariance, (0, 5)),
    }
    yield "odometry", schema.ODOMETRY, fields


def _log(message: Event, service: str) -> View:
    text = f"{message.name}: {message.text}"
    fields = {"level": LEVELS[message.level], "message": text, "name": service}
    return "log", schema.LOG, {**fields, "file": "", "line": 0}


def _vector(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> dict[str, float]:
    return {"x": x, "y": y, "z": z}


def _pose(x: float, y: float, heading: float) -> dict[str, dict[str, float]]:
    rotation = {"z": math.sin(heading / 2), "w": math.cos(heading / 2)}
    return {"position": _vector(x, y), "orientation": {"x": 0.0, "y": 0.0, **rotation}}


def _expanded(covariance: tuple[float, ...], axes: tuple[int, ...]) -> list[float]:
    """Return the 6x6 covariance, row by row, for a covariance of some of its axes."""
    expanded = [0.0] * 36
    for row, row_axis in enumerate(axes):
        for column, column_axis in enumerate(axes):
            expanded[6 * row_axis + column_axis] = covariance[row * len(axes) + column]
    return expanded
