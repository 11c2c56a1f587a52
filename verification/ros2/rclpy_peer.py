"""Messages as rclpy itself reads and writes them; run with the Python of an environment with rclpy.

It reads ``{type: [payload in hex, ...]}`` as JSON from standard input, and prints for each type its
hash, the values of the payloads as nested lists, and the payloads that rclpy makes of them again.
It imports nothing of T2.
"""

import importlib
import json
import sys
from pathlib import Path
from typing import Any

from rclpy.serialization import (  # type: ignore[import-not-found]
    deserialize_message,
    serialize_message,
)

SHARE = Path(sys.prefix) / "share"  # of ROS packages: the definitions of their types


def class_of(name: str) -> Any:
    """Return the class of a type such as std_srvs/srv/Trigger_Response."""
    package, kind, message = name.split("/")
    outer, _, inner = message.partition("_")
    found = getattr(importlib.import_module(f"{package}.{kind}"), outer)
    return getattr(found, inner) if inner else found


def hash_of(name: str) -> str:
    """Return the hash of a message or a service, by its package."""
    service = name.partition("_Re")[0]  # of a request or a response
    described = json.loads((SHARE / f"{service}.json").read_text(encoding="utf-8"))
    known = {it["type_name"]: it["hash_string"] for it in described["type_hashes"]}
    return str(known[service])


def as_value(field: Any) -> Any:
    """Return a field as JSON has it."""
    if hasattr(field, "get_fields_and_field_types"):
        return [as_value(getattr(field, name)) for name in field.get_fields_and_field_types()]
    if isinstance(field, bytes):  # one byte
        return field[0]
    if isinstance(field, str) or not hasattr(field, "__iter__"):
        return field
    return [as_value(item) for item in (field.tolist() if hasattr(field, "tolist") else field)]


def main() -> None:
    """Answer what standard input asks."""
    answers = {}
    for name, payloads in json.load(sys.stdin).items():
        of_type = class_of(name)
        messages = [deserialize_message(bytes.fromhex(each), of_type) for each in payloads]
        answers[name] = {
            "hash": hash_of(name),
            "values": [as_value(each) for each in messages],
            "payloads": [serialize_message(each).hex() for each in messages],
        }
    json.dump(answers, sys.stdout)


if __name__ == "__main__":
    main()
