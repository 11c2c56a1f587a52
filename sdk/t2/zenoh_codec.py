"""``zenoh --decoder t2 --encoder t2``: our messages as JSON on zenoh-cli's command line.

Decoding needs only MessagePack, so it also shows invalid messages. Encoding adds the header to
hand-typed messages; requests to srv/ have none.
"""

import json
import secrets
import time
from itertools import count

import msgspec

_BOOT = secrets.randbits(63)
_seq = count(1)


def decode(key: object, value: bytes) -> str:
    """Return a payload as one line of JSON: ``null`` if empty, hex if it is not MessagePack."""
    if not value:
        return "null"
    try:
        text = json.dumps(msgspec.msgpack.decode(value), ensure_ascii=False, default=_shown)
    except (ValueError, TypeError, RecursionError, msgspec.MsgspecError):
        return json.dumps({"not_msgpack": value.hex()})
    # Control and formatting characters are escaped: a payload does not control the terminal.
    return "".join(c if c.isprintable() else json.dumps(c)[1:-1] for c in text)


def encode(key: str, value: str) -> bytes:
    """Return a JSON object as a message with header; raise ``ValueError`` for other JSON."""
    message = json.loads(value)
    if not isinstance(message, dict):
        raise ValueError('a message is a JSON object, such as {"linear": 0.1, "angular": 0}')
    if "/srv/" in key:  # a request has no header
        return msgspec.msgpack.encode(message)
    header = {
        "seq": next(_seq),
        "boot": _BOOT,
        "t_ns": time.time_ns(),
        "mono_ns": time.monotonic_ns(),
    }
    return msgspec.msgpack.encode({**header, **message})


def _shown(value: object) -> str:
    if isinstance(value, msgspec.msgpack.Ext):
        return f"Ext({value.code}, {bytes(value.data).hex()})"
    return value.hex() if isinstance(value, bytes) else str(value)
