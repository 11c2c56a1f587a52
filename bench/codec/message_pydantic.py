"""The bus's messages as ``pydantic`` models, strict as T2's: by JSON, and by ``msgpack``."""

from typing import Annotated, Any, Literal

import msgpack
from pydantic import BaseModel, ConfigDict, Field

from bench.codec.candidate import Candidate

Ranges = Annotated[tuple[float | None, ...], Field(min_length=8, max_length=8)]
Status = Literal["ok", "fault", "too_near", "no_echo"]
Statuses = Annotated[tuple[Status, ...], Field(min_length=8, max_length=8)]
Covariance3 = Annotated[tuple[float, ...], Field(min_length=9, max_length=9)]
Covariance2 = Annotated[tuple[float, ...], Field(min_length=4, max_length=4)]


class Model(BaseModel):
    """What all models are: frozen, and no text passes for a number."""

    model_config = ConfigDict(strict=True, frozen=True)


class Message(Model):
    """The header of every message."""

    seq: int = 0
    boot: int = 0
    t_ns: int = 0
    mono_ns: int = 0
    host: int = 0


class Velocity(Message):
    """Measured by the board."""

    linear: float
    angular: float


class Bumper(Message):
    """The bumper strip."""

    pressed: bool
    lost: int = 0


class Ultrasonic(Message):
    """Eight ranges."""

    ranges: Ranges
    status: Statuses


class Motion(Message):
    """What safety lets through."""

    command: Literal["run", "stop", "brake"]
    linear: float = 0.0
    angular: float = 0.0
    source: str | None = None
    judged: int = 0
    judged_boot: int = 0
    latched: bool = False
    predecessor: int | None = None
    asked_ns: int = 0
    heard_ns: int = 0
    judged_ns: int = 0


class Cause(Model):
    """One reason why the vehicle may not move as asked."""

    name: str
    action: Literal["slow", "stop", "brake"]
    age: float
    text: str
    id: int = 0


class Limits(Model):
    """What safety allows."""

    forward: float
    backward: float
    angular: float


class SafetyState(Message):
    """What safety decided and why."""

    verdict: Literal["run", "slow", "stop", "brake", "inhibited"]
    latched: tuple[str, ...]
    causes: tuple[Cause, ...]
    source: str | None
    limits: Limits
    heartbeat: int
    text: str
    release: None = None


class Odometry(Message):
    """Pose and twist."""

    x: float
    y: float
    heading: float
    linear: float
    angular: float
    pose_covariance: Covariance3
    twist_covariance: Covariance2
    epoch: int
    residual: float | None
    slip: bool
    frame_id: str = "odom"
    child_frame_id: str = "base_link"


KINDS: tuple[type[Message], ...] = Velocity, Bumper, Ultrasonic, Motion, SafetyState, Odometry


def json_of(kind: type[Message]) -> Any:
    """Return what makes JSON of fields."""
    return lambda fields: kind(**fields).model_dump_json().encode()


def msgpack_of(kind: type[Message]) -> Any:
    """Return what makes MessagePack of fields."""
    return lambda fields: msgpack.packb(kind(**fields).model_dump())


def from_msgpack(kind: type[Message]) -> Any:
    """Return what makes a model of MessagePack; strict models take no list for a tuple."""
    return lambda raw: kind.model_validate(msgpack.unpackb(raw, use_list=False))


def _plain(name: str, model: Message) -> Any:
    return model.model_dump()


JSON = Candidate(
    name="pydantic, JSON",
    encode={kind.__name__: json_of(kind) for kind in KINDS},
    decode={kind.__name__: kind.model_validate_json for kind in KINDS},
    plain=_plain,
)
MSGPACK = Candidate(
    name="pydantic, msgpack",
    encode={kind.__name__: msgpack_of(kind) for kind in KINDS},
    decode={kind.__name__: from_msgpack(kind) for kind in KINDS},
    plain=_plain,
)
