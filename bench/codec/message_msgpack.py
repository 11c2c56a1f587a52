"""The bus's messages with ``msgpack`` and checks by hand: every one of T2's, into a plain map.

Each reader names what is required, of which type and how long; what may be left out gets its
default.
"""

from collections.abc import Callable
from typing import Any

import msgpack

from bench.codec.candidate import Candidate

Fields = dict[str, Any]

STATUSES = {"ok", "fault", "too_near", "no_echo"}
VERDICTS = {"run", "slow", "stop", "brake", "inhibited"}
ACTIONS = {"slow", "stop", "brake"}
COMMANDS = {"run", "stop", "brake"}


def refuse(name: str) -> None:
    """Raise ``ValueError`` with the field's name."""
    raise ValueError(name)


def integer(fields: Fields, name: str, default: int | None = None) -> None:
    """Check a whole number; without a default it is required."""
    value = fields.setdefault(name, default) if default is not None else fields[name]
    if type(value) is not int:
        refuse(name)


def number(fields: Fields, name: str, default: float | None = None) -> None:
    """Check a number; without a default it is required."""
    value = fields.setdefault(name, default) if default is not None else fields[name]
    if type(value) is not float and type(value) is not int:
        refuse(name)


def text(fields: Fields, name: str, default: str | None = None) -> None:
    """Check a text; without a default it is required."""
    value = fields.setdefault(name, default) if default is not None else fields[name]
    if type(value) is not str:
        refuse(name)


def numbers(fields: Fields, name: str, length: int) -> None:
    """Check a list of so many numbers."""
    values = fields[name]
    if type(values) is not list or len(values) != length:
        refuse(name)
    for value in values:
        if type(value) is not float and type(value) is not int:
            refuse(name)


def truth(value: object, name: str) -> None:
    """Check a truth value."""
    if value is not True and value is not False:
        refuse(name)


def opened(raw: bytes) -> Fields:
    """Return a message's map with its header checked."""
    fields: Fields = msgpack.unpackb(raw)
    if type(fields) is not dict:
        refuse("message")
    for name in ("seq", "boot", "t_ns", "mono_ns", "host"):
        if type(fields.setdefault(name, 0)) is not int:
            refuse(name)
    return fields


def velocity(raw: bytes) -> Fields:
    """Read a velocity."""
    fields = opened(raw)
    number(fields, "linear")
    number(fields, "angular")
    return fields


def bumper(raw: bytes) -> Fields:
    """Read a bumper sample."""
    fields = opened(raw)
    truth(fields["pressed"], "pressed")
    integer(fields, "lost", 0)
    return fields


def ultrasonic(raw: bytes) -> Fields:
    """Read eight ranges."""
    fields = opened(raw)
    ranges, status = fields["ranges"], fields["status"]
    if type(ranges) is not list or len(ranges) != 8:
        refuse("ranges")
    for value in ranges:
        if value is not None and type(value) is not float and type(value) is not int:
            refuse("ranges")
    if type(status) is not list or len(status) != 8 or not STATUSES.issuperset(status):
        refuse("status")
    return fields


def motion(raw: bytes) -> Fields:
    """Read a motion."""
    fields = opened(raw)
    if fields["command"] not in COMMANDS:
        refuse("command")
    number(fields, "linear", 0.0)
    number(fields, "angular", 0.0)
    source = fields.setdefault("source", None)
    if source is not None and type(source) is not str:
        refuse("source")
    truth(fields.setdefault("latched", False), "latched")
    predecessor = fields.setdefault("predecessor", None)
    if predecessor is not None and type(predecessor) is not int:
        refuse("predecessor")
    for name in ("judged", "judged_boot", "asked_ns", "heard_ns", "judged_ns"):
        integer(fields, name, 0)
    return fields


def cause(fields: Fields) -> None:
    """Check one cause of a state."""
    if type(fields) is not dict:
        refuse("causes")
    text(fields, "name")
    if fields["action"] not in ACTIONS:
        refuse("action")
    number(fields, "age")
    text(fields, "text")
    integer(fields, "id", 0)


def state(raw: bytes) -> Fields:
    """Read what safety decided."""
    fields = opened(raw)
    if fields["verdict"] not in VERDICTS:
        refuse("verdict")
    latched, causes, limits = fields["latched"], fields["causes"], fields["limits"]
    if type(latched) is not list or type(causes) is not list or type(limits) is not dict:
        refuse("latched, causes or limits")
    for name in latched:
        if type(name) is not str:
            refuse("latched")
    for one in causes:
        cause(one)
    number(limits, "forward")
    number(limits, "backward")
    number(limits, "angular")
    source = fields["source"]
    if source is not None and type(source) is not str:
        refuse("source")
    integer(fields, "heartbeat")
    text(fields, "text")
    if fields.setdefault("release", None) is not None:
        refuse("release")
    return fields


def odometry(raw: bytes) -> Fields:
    """Read a pose and a twist."""
    fields = opened(raw)
    for name in ("x", "y", "heading", "linear", "angular"):
        number(fields, name)
    numbers(fields, "pose_covariance", 9)
    numbers(fields, "twist_covariance", 4)
    integer(fields, "epoch")
    residual = fields["residual"]
    if residual is not None and type(residual) is not float and type(residual) is not int:
        refuse("residual")
    truth(fields["slip"], "slip")
    text(fields, "frame_id", "odom")
    text(fields, "child_frame_id", "base_link")
    return fields


READERS: dict[str, Callable[[bytes], Fields]] = {
    "Velocity": velocity,
    "Bumper": bumper,
    "Ultrasonic": ultrasonic,
    "Motion": motion,
    "SafetyState": state,
    "Odometry": odometry,
}


def packed(fields: Fields) -> bytes:
    """Return a message, its map made anew as the others make their objects."""
    raw: bytes = msgpack.packb({**fields})
    return raw


def packed_state(fields: Fields) -> bytes:
    """Return a state, with what is nested in it made anew too."""
    causes = [{**cause} for cause in fields["causes"]]
    raw: bytes = msgpack.packb({**fields, "causes": causes, "limits": {**fields["limits"]}})
    return raw


BY_HAND = Candidate(
    name="msgpack by hand",
    encode={**dict.fromkeys(READERS, packed), "SafetyState": packed_state},
    decode=READERS,
    plain=lambda name, fields: fields,
)
