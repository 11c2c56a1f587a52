"""The bus's messages as services publish and read them."""

from typing import Any

import msgspec

from bench.codec.candidate import Candidate
from common import codec
from common.messages import (
    Bumper,
    Cause,
    Limits,
    Motion,
    Odometry,
    SafetyState,
    Ultrasonic,
    Velocity,
)

KINDS = Velocity, Bumper, Ultrasonic, Motion, SafetyState, Odometry


def state(fields: dict[str, Any]) -> bytes:
    """Return a state, with what is nested in it made anew too."""
    causes = tuple([Cause(**cause) for cause in fields["causes"]])
    limits = Limits(**fields["limits"])
    return codec.encode(SafetyState(**{**fields, "causes": causes, "limits": limits}))


def _plain(name: str, message: msgspec.Struct) -> Any:
    return msgspec.to_builtins(message)


T2 = Candidate(
    name="T2",
    encode={
        "Velocity": lambda fields: codec.encode(Velocity(**fields)),
        "Bumper": lambda fields: codec.encode(Bumper(**fields)),
        "Ultrasonic": lambda fields: codec.encode(Ultrasonic(**fields)),
        "Motion": lambda fields: codec.encode(Motion(**fields)),
        "SafetyState": state,
        "Odometry": lambda fields: codec.encode(Odometry(**fields)),
    },
    decode={
        "Velocity": lambda raw: codec.decode(raw, Velocity),
        "Bumper": lambda raw: codec.decode(raw, Bumper),
        "Ultrasonic": lambda raw: codec.decode(raw, Ultrasonic),
        "Motion": lambda raw: codec.decode(raw, Motion),
        "SafetyState": lambda raw: codec.decode(raw, SafetyState),
        "Odometry": lambda raw: codec.decode(raw, Odometry),
    },
    plain=_plain,
)
