"""The bus's messages by ``protobuf`` (proto3), their schema made at run time: no ``protoc``.

A list of protobuf has no gaps: a range that may be missing is a message with an optional number.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import Message

from bench.codec.candidate import Candidate

PACKAGE = "t2.bench"
FIELD = descriptor_pb2.FieldDescriptorProto
SCALARS = {
    "double": FIELD.TYPE_DOUBLE,
    "int64": FIELD.TYPE_INT64,
    "bool": FIELD.TYPE_BOOL,
    "string": FIELD.TYPE_STRING,
}
# An enum's name stands where its values are; the first is what an absent one reads as.
ENUMS = {
    "Status": ("ok", "fault", "too_near", "no_echo"),
    "Verdict": ("run", "slow", "stop", "brake", "inhibited"),
    "Action": ("slow", "stop", "brake"),
    "Command": ("run", "stop", "brake"),
}
HEADER = ("int64 seq", "int64 boot", "int64 t_ns", "int64 mono_ns", "int64 host")
# A field is "type name", and before it "repeated" or "optional" as in a proto file.
SCHEMA: Mapping[str, Sequence[str]] = {
    "Velocity": (*HEADER, "double linear", "double angular"),
    "Bumper": (*HEADER, "bool pressed", "int64 lost"),
    "Range": ("optional double m",),
    "Ultrasonic": (*HEADER, "repeated Range ranges", "repeated Status status"),
    "Motion": (
        *HEADER, "Command command", "double linear", "double angular", "optional string source",
        "int64 judged", "int64 judged_boot", "bool latched", "optional int64 predecessor",
        "int64 asked_ns", "int64 heard_ns", "int64 judged_ns",
    ),
    "Cause": ("string name", "Action action", "double age", "string text", "int64 id"),
    "Limits": ("double forward", "double backward", "double angular"),
    "SafetyState": (
        *HEADER, "Verdict verdict", "repeated string latched", "repeated Cause causes",
        "optional string source", "Limits limits", "int64 heartbeat", "string text",
        "optional string release",
    ),
    "Odometry": (
        *HEADER, "double x", "double y", "double heading", "double linear", "double angular",
        "repeated double pose_covariance", "repeated double twist_covariance", "int64 epoch",
        "optional double residual", "bool slip", "string frame_id", "string child_frame_id",
    ),
}  # fmt: skip


def classes() -> Mapping[str, Any]:
    """Return the class of each message, made from ``SCHEMA``."""
    file = descriptor_pb2.FileDescriptorProto(name="bench.proto", package=PACKAGE, syntax="proto3")
    for name, lines in SCHEMA.items():
        message = file.message_type.add(name=name)
        for number, line in enumerate(lines, 1):
            _declare(message, number, line)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return {
        name: message_factory.GetMessageClass(pool.FindMessageTypeByName(f"{PACKAGE}.{name}"))
        for name in SCHEMA
    }


def _declare(message: Any, number: int, line: str) -> None:
    *rule, kind, name = line.split()
    field = message.field.add(name=name, number=number, label=FIELD.LABEL_OPTIONAL)
    if kind in SCALARS:
        field.type = SCALARS[kind]
    elif kind in ENUMS:
        enum = message.enum_type.add(name=kind)
        for value, word in enumerate(ENUMS[kind]):
            enum.value.add(name=word, number=value)
        field.type = FIELD.TYPE_ENUM
        field.type_name = f".{PACKAGE}.{message.name}.{kind}"
    else:
        field.type = FIELD.TYPE_MESSAGE
        field.type_name = f".{PACKAGE}.{kind}"
    if rule == ["repeated"]:
        field.label = FIELD.LABEL_REPEATED
    elif rule == ["optional"]:
        field.proto3_optional = True
        field.oneof_index = len(message.oneof_decl)
        message.oneof_decl.add(name=f"_{name}")


KINDS = classes()
NAMES = ("Velocity", "Bumper", "Ultrasonic", "Motion", "SafetyState", "Odometry")


def bytes_of(kind: Any) -> Any:
    """Return what makes bytes of fields."""
    return lambda fields: kind(**fields).SerializeToString()


def ultrasonic(fields: dict[str, Any]) -> bytes:
    """Return eight ranges as bytes."""
    ranges = [{} if value is None else {"m": value} for value in fields["ranges"]]
    made: bytes = KINDS["Ultrasonic"](**{**fields, "ranges": ranges}).SerializeToString()
    return made


def _plain(name: str, message: Message) -> Any:
    plain = {each.name: _value(message, each) for each in message.DESCRIPTOR.fields}
    if name == "Ultrasonic":
        plain["ranges"] = [each["m"] for each in plain["ranges"]]
    return plain


def _value(message: Message, field: Any) -> Any:
    value = getattr(message, field.name)
    if field.has_presence and field.message_type is None and not message.HasField(field.name):
        return None
    if field.message_type is not None:
        many = field.is_repeated
        return [_plain("", each) for each in value] if many else _plain("", value)
    if field.enum_type is not None:
        names = field.enum_type.values_by_number
        many = field.is_repeated
        return [names[each].name for each in value] if many else names[value].name
    return list(value) if field.is_repeated else value


PROTOBUF = Candidate(
    name="protobuf",
    encode={**{name: bytes_of(KINDS[name]) for name in NAMES}, "Ultrasonic": ultrasonic},
    decode={name: KINDS[name].FromString for name in NAMES},
    plain=_plain,
)
