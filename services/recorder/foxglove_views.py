"""What a 3D panel and a log panel draw, made from our messages in Foxglove's own schemas.

Each sonar is a scan of its own, seen from ``base_link``: eight ranges from eight places are no scan
of one sensor. Frames and units are ours: REP-103 and REP-105, metres, radians.
"""

import math
from collections.abc import Iterator
from typing import Any

from common.codec import finite
from common.freshness import NS_PER_S
from common.messages import SONAR_NAMES, Event, Message, Odometry, Ultrasonic
from common.settings import Vehicle
from common.vehicle import sonar_mounts
from services.recorder import schema
from services.recorder.schema import Schema

CONE = 0.5  # rad, drawn; the sensors' real opening is not in the manual
POINTS = 5  # of the arc at which something is, somewhere
LEVELS = {"info": 2, "warning": 3, "error": 4}

View = tuple[str, Schema, dict[str, Any]]  # topic, schema, message


class Views:
    """Draws for one vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._poses = [_pose(m.x, m.y, m.yaw) for m in sonar_mounts(vehicle)]

    def of(self, message: Message, service: str, log_ns: int) -> Iterator[View]:
        """Yield what is drawn of a message of a service, stamped with the file's own time."""
        timestamp = {"sec": log_ns // NS_PER_S, "nsec": log_ns % NS_PER_S}
        match message:
            case Odometry() if finite(message.x, message.y, message.heading):
                drawn = _odometry(message)
            case Ultrasonic():
                drawn = self._scans(message)
            case Event():
                drawn = iter([_log(message, service)])
            case _:
                drawn = iter(())
        for topic, kind, fields in drawn:
            yield f"foxglove/{topic}", kind, {"timestamp": timestamp, **fields}

    def _scans(self, message: Ultrasonic) -> Iterator[View]:
        for name, pose, far in zip(SONAR_NAMES, self._poses, message.ranges, strict=True):
            fields = {
                "frame_id": "base_link",
                "pose": pose,
                "start_angle": -CONE / 2,
                "end_angle": CONE / 2,
                "ranges": [] if far is None else [far] * POINTS,
                "intensities": [],
            }
            yield f"sonar/{name}", schema.SCAN, fields


def _odometry(message: Odometry) -> Iterator[View]:
    pose = _pose(message.x, message.y, message.heading)
    outer, inner = message.frame_id, message.child_frame_id
    yield "pose", schema.POSE, {"frame_id": outer, "pose": pose}
    transform = {
        "parent_frame_id": outer,
        "child_frame_id": inner,
        "translation": pose["position"],
        "rotation": pose["orientation"],
    }
    yield "tf", schema.TRANSFORM, transform
    fields = {
        "frame_id": outer,
        "child_frame_id": inner,
        "pose": pose,
        "linear_velocity": _vector(x=message.linear),
        "angular_velocity": _vector(z=message.angular),
        "pose_covariance": _spread(message.pose_covariance, (0, 1, 5)),
        "velocity_covariance": _spread(message.twist_covariance, (0, 5)),
    }
    yield "odometry", schema.ODOMETRY, fields


def _log(message: Event, service: str) -> View:
    text = f"{message.name}: {message.text}"
    fields = {"level": LEVELS[message.level], "message": text, "name": service}
    return "log", schema.LOG, {**fields, "file": "", "line": 0}


def _vector(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> dict[str, float]:
    return {"x": x, "y": y, "z": z}


def _pose(x: float, y: float, heading: float) -> dict[str, dict[str, float]]:
    turned = {"z": math.sin(heading / 2), "w": math.cos(heading / 2)}
    return {"position": _vector(x, y), "orientation": {"x": 0.0, "y": 0.0, **turned}}


def _spread(small: tuple[float, ...], axes: tuple[int, ...]) -> list[float]:
    """Return a covariance over some of six axes as one over all, row by row."""
    whole = [0.0] * 36
    for row, outer in enumerate(axes):
        for column, inner in enumerate(axes):
            whole[6 * outer + inner] = small[row * len(axes) + column]
    return whole
