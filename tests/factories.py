"""Factories of test messages: a valid message with default fields, except the given ones."""

from typing import Any

from t2.messages import (
    Cause,
    FixState,
    Health,
    Limits,
    LimitState,
    Link,
    MapPose,
    Odometry,
    PatrolState,
    Phrase,
    PlaneFrame,
    Release,
    SafetyState,
)
from t2.words import render


def safety_state(**fields: Any) -> SafetyState:
    """Return a safety state without causes."""
    usual: dict[str, Any] = {
        "verdict": "run",
        "latched": (),
        "causes": (),
        "source": "teleop",
        "limits": Limits(forward=1.0, backward=0.5, angular=1.0),
        "heartbeat": 7,
        "text": "Driving.",
    }
    return SafetyState(**usual | fields)


def limit_source(source: str, **fields: Any) -> LimitState:
    """Return the state of a source without a cap."""
    usual: dict[str, Any] = {
        "linear": None,
        "angular": None,
        "reason": "",
        "age": 0.1,
        "lease": 1.0,
        "silence": "stop",
        "silent": False,
        "effect": "none",
    }
    return LimitState(source=source, **usual | fields)


def release(**fields: Any) -> Release:
    """Return the release state after a contact in forward motion."""
    usual: dict[str, Any] = {
        "believed_free": "backward",
        "travelled": 0.43,
        "age": 12.0,
        "forbidden": (),
        "left": 0.12,
    }
    return Release(**usual | fields)


def contact_state(**fields: Any) -> SafetyState:
    """Return a safety state with a latched contact."""
    pressed = Cause(name="contact", action="brake", age=12.0, text="The bumper was hit.", id=42)
    usual: dict[str, Any] = {
        "verdict": "brake",
        "latched": ("contact",),
        "causes": (pressed,),
        "source": None,
        "text": "The bumper is pressed.",
        "release": release(),
    }
    return safety_state(**usual | fields)


def link(**fields: Any) -> Link:
    """Return the state of an established link."""
    usual: dict[str, Any] = {
        "state": "up",
        "board": "10.7.5.224:4002",
        "epoch": 0,
        "armed": True,
        "waiting": "",
        "rates": {"Velocity": 50.0, "Driver": 2.0},
        "rejected": {},
        "round_trip": 0.0008,
    }
    return Link(**usual | fields)


def odometry(**fields: Any) -> Odometry:
    """Return an odometry sample."""
    usual: dict[str, Any] = {
        "x": 1.234,
        "y": -0.4,
        "heading": 1.5708,
        "linear": 0.2,
        "angular": 0.0,
        "pose_covariance": (0.0,) * 9,
        "twist_covariance": (0.0,) * 4,
        "epoch": 0,
        "residual": 0.004,
        "slip": False,
    }
    return Odometry(**usual | fields)


def map_pose(state: Any = "placed", **fields: Any) -> MapPose:
    """Return a pose in the map; one that is not placed has none."""
    phrase = Phrase("map.unplaced")
    usual: dict[str, Any] = {"state": state, "odom_boot": 1, "odom_seq": 1, "placement": 0}
    if state != "unplaced":
        name = "map.placed" if state == "placed" else "map.uncertain"
        phrase = Phrase(name, {"sigma": 0.2, "degrees": 3.0})
        usual |= {
            "x": 4.0, "y": 2.0, "heading": 0.5, "odom": PlaneFrame(x=3.0, y=1.0, heading=0.0),
            "pose_covariance": (0.04, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.0025), "placement": 1,
        }  # fmt: skip
    return MapPose(**usual | {"text": render([phrase]), "phrases": (phrase,)} | fields)


def patrol_state(state: Any = "driving", **fields: Any) -> PatrolState:
    """Return the state of patrol on a round, at 4 of 10 m."""
    phrase = Phrase("patrol.driving", {"route": "yard", "station": "gate"})
    usual: dict[str, Any] = {
        "actions": ("pause", "return", "abort"), "round": "1-yard", "route": "yard",
        "progress": 4.0, "length": 10.0, "station": "gate", "deviation": 0.1, "sigma": 0.05,
        "corridor": 0.5, "phrases": (phrase,),
    }  # fmt: skip
    if state == "idle":
        phrase = Phrase("patrol.idle")
        usual = {"actions": ("start",), "phrases": (phrase,)}
    return PatrolState(state=state, **usual | {"text": render([phrase])} | fields)


def fix_state(source: str = "tags", **fields: Any) -> FixState:
    """Return the state of a source whose fixes are used."""
    usual: dict[str, Any] = {"age": 0.1, "used": 5, "refused": 1, "in_a_row": 0}
    return FixState(source=source, **usual | fields)


def health(service: str = "bridge", **fields: Any) -> Health:
    """Return the health of a service."""
    usual: dict[str, Any] = {
        "version": "0.1.0",
        "uptime": 60.0,
        "rates": {},
        "counters": {},
        "lateness": 0.0,
        "rss": 50_000_000,
    }
    return Health(service=service, **usual | fields)
