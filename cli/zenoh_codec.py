"""``zenoh --decoder t2 --encoder t2``: our messages as JSON on zenoh-cli's command line.

Decoding needs only MessagePack, so it also shows invalid messages. Encoding adds the header to
hand-typed messages; requests to srv/ have none.
"""

import json
import secrets
import time
from itertools import count

import msgpack

from common import clock
from common.text import printable

_BOOT = secrets.randbits(63)
_seq = count(1)


def decode(key: object, value: bytes) -> str:
    """Return a payload as one line of JSON: ``null`` if empty, hex if it is not MessagePack."""
    if not value:
        return "null"
    try:
        return printable(json.dumps(msgpack.unpackb(value), ensure_ascii=False, default=_shown))
    except (ValueError, TypeError, RecursionError, msgpack.UnpackException):
        return json.dumps({"not_msgpack": value.hex()})


def encode(key: str, value: str) -> bytes:
    """Return a JSON object as a message with header; raise ``ValueError`` for other JSON."""
    message = json.loads(value)
    if not isinstance(message, dict):
        raise ValueError('a message is a JSON object, such as {"linear": 0.1, "angular": 0}')
    if "/srv/" in key:  # a request has no header
        return _packed(message)
    header = {
        "seq": next(_seq),
        "boot": _BOOT,
        "t_ns": time.time_ns(),
        "mono_ns": clock.now_ns(),
    }
    return _packed({**header, **message})


def _packed(message: dict[str, object]) -> bytes:
    packed: bytes = msgpack.packb(message)
    return packed


def _shown(value: object) -> str:
    return value.hex() if isinstance(value, bytes) else str(value)
