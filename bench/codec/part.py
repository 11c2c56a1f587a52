"""The part ``codec``: every codec on the same values, proven equal before it is timed."""

from collections.abc import Sequence
from functools import partial
from importlib.metadata import version
from typing import Any

import msgspec

from bench.codec import frame_ctypes, frame_struct, frame_t2, message_msgpack, message_t2
from bench.codec.candidate import Candidate
from bench.codec.values import FRAMES, MESSAGES
from bench.rounds import Row, measured
from bench.series import Series

PACKAGES = "msgspec", "crcmod-plus", "msgpack", "construct", "pydantic", "protobuf"


def frame_codecs() -> Sequence[Candidate]:
    """Return who reads and makes frames; T2 first, then the floor."""
    # Here and not above: what was measured is told without what only measuring needs.
    from bench.codec.frame_construct import CONSTRUCT

    return frame_t2.T2, frame_struct.BY_HAND, frame_ctypes.CTYPES, CONSTRUCT


def message_codecs() -> Sequence[Candidate]:
    """Return who reads and makes messages; T2 first, then what is done by hand."""
    from bench.codec.message_protobuf import PROTOBUF
    from bench.codec.message_pydantic import JSON, MSGPACK

    return message_t2.T2, message_msgpack.BY_HAND, JSON, MSGPACK, PROTOBUF


def measure() -> list[Series]:
    """Return the samples of all codecs, frames and messages in one run."""
    both = (frame_codecs(), FRAMES), (message_codecs(), MESSAGES)
    return measured([row for codecs, values in both for row in rows(codecs, values)])


def versions() -> str:
    """Return what is compared, with versions."""
    return ", ".join(f"{name} {version(name)}" for name in PACKAGES)


def rows(codecs: Sequence[Candidate], values: dict[str, Any]) -> list[Row]:
    """Return each codec's rows, both ways; raise ``ValueError`` for one that spoils a value."""
    made = []
    for name, value in values.items():
        for codec in codecs:
            if not same(codec.there_and_back(name, value), value):
                raise ValueError(f"{codec.name} spoils {name}: nothing to compare")
            raw = codec.encode[name](value)
            size = str(len(raw))
            encode, decode = partial(codec.encode[name], value), partial(codec.decode[name], raw)
            made.append(Row((name, codec.name, "encode"), encode, codec.calls, size))
            made.append(Row((name, codec.name, "decode"), decode, codec.calls, size))
    return made


def same(one: Any, other: Any) -> bool:
    """Tell whether two values are the same, tuple or list."""
    plain = partial(msgspec.json.encode, order="sorted")
    return plain(one) == plain(other)
