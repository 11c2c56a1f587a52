"""Fuzz targets, and the properties that hold for all inputs.

The declared error of a parser is an allowed outcome. Any other exception, and any violated
property, is a finding.
"""

import math
import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from msgspec import Struct

from cli.settings import Everything
from common.config import Sources, flatten, load
from common.errors import ConfigError
from common.wire import framing
from common.wire.commands import TO_BOARD
from common.wire.framing import Received
from common.wire.reports import FROM_BOARD
from t2 import keys
from t2.codec import decode, encode
from t2.errors import MessageError

TABLES = FROM_BOARD, TO_BOARD
CALLED = [kind for call in keys.CALLS for kind in (call.request, call.reply)]
KINDS: list[type[Struct]] = [*dict.fromkeys([topic.message for topic in keys.TOPICS] + CALLED)]
SEPARATOR = b"\0"  # cannot occur in arguments and environment variables


def frames(data: bytes) -> None:
    """Read a datagram; the first byte selects the sender."""
    kinds = TABLES[data[0] % len(TABLES) if data else 0]
    datagram = data[1:]
    parts = framing.read(datagram, kinds)
    assert b"".join(part.raw for part in parts) == datagram, "bytes were lost or added"
    for part in parts:
        if isinstance(part, Received):
            (again,) = framing.read(framing.pack(part.frame), kinds)
            assert isinstance(again, Received), again
            assert again.frame == part.frame


def messages(data: bytes) -> None:
    """Decode a message or request; the first byte selects its type."""
    kind = KINDS[data[0] % len(KINDS) if data else 0]
    try:
        message = decode(data[1:], kind)
    except MessageError as error:
        _check(error, kind.__name__)
        return
    assert type(message) is kind
    sent = encode(message)
    assert encode(decode(sent, kind)) == sent, "encoding and decoding differ"


def toml(data: bytes) -> None:
    """Read a settings file."""
    SCRATCH.write_bytes(data)
    _settings((SCRATCH,), {}, ())


def environ(data: bytes) -> None:
    """Read settings from an environment: ``BOARD__PORT=1``, with the prefix ``T2__``."""
    pairs = (os.fsdecode(part).partition("=") for part in data.split(SEPARATOR))
    _settings((), {f"T2__{name}": value for name, _, value in pairs}, ())


def sets(data: bytes) -> None:
    """Read settings from the command line: the arguments of ``--set``."""
    _settings((), {}, [os.fsdecode(part) for part in data.split(SEPARATOR)])


def _settings(files: Sequence[Path], given: Mapping[str, str], words: Sequence[str]) -> None:
    try:
        loaded = load(Everything, Sources(files, given, words))
    except ConfigError as error:
        _check(error, ": ")
        return
    non_finite = [(path, value) for path, value in flatten(loaded.config) if not _finite(value)]
    assert not non_finite, f"non-finite settings: {non_finite}"


def _check(error: Exception, words: str) -> None:
    """Check that the error names its subject."""
    assert words in str(error), error


def _finite(value: Any) -> bool:
    if isinstance(value, tuple):
        return all(map(_finite, value))
    return not isinstance(value, float) or math.isfinite(value)


_folder = tempfile.TemporaryDirectory(prefix="t2-fuzz-")
SCRATCH = Path(_folder.name) / "fuzzed.toml"

TARGETS: dict[str, Callable[[bytes], None]] = {
    target.__name__: target for target in (frames, messages, toml, environ, sets)
}
