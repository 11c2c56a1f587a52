"""What is fuzzed, and what must hold whatever the bytes are.

A target takes bytes and returns. The declared error of its part is an allowed outcome; any other
exception, and any property that does not hold, is a finding and leaves the target.
"""

import math
import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from msgspec import Struct

from cli.settings import Everything
from common import keys
from common.codec import decode, encode
from common.config import Sources, flatten, load
from common.errors import ConfigError, MessageError, RobotError
from common.wire.commands import TO_BOARD
from common.wire.framing import Covers, Framing, Received
from common.wire.reports import FROM_BOARD

COVERS: tuple[Covers, ...] = ("payload", "header_and_payload")
FRAMINGS = [(Framing("crc-16", covers), kinds)
            for covers in COVERS for kinds in (FROM_BOARD, TO_BOARD)]  # fmt: skip
KINDS: tuple[type[Struct], ...] = tuple(
    dict.fromkeys(
        [
            *(topic.message for topic in keys.TOPICS),
            *(call.request for call in keys.CALLS),
            *(call.reply for call in keys.CALLS),
        ]
    )
)
SEPARATOR = b"\0"  # as in an argument list and an environment, which cannot hold it


def frames(data: bytes) -> None:
    """Read a datagram; the first byte picks the sender and what its CRC covers."""
    framing, kinds = FRAMINGS[data[0] % len(FRAMINGS) if data else 0]
    datagram = data[1:]
    parts = framing.read(datagram, kinds)
    assert b"".join(part.raw for part in parts) == datagram, "bytes were lost or made up"
    for part in parts:
        if isinstance(part, Received):
            (again,) = framing.read(framing.pack(part.frame), kinds)
            assert isinstance(again, Received), again
            assert again.frame == part.frame


def messages(data: bytes) -> None:
    """Decode a message or request; the first byte picks which."""
    kind = KINDS[data[0] % len(KINDS) if data else 0]
    try:
        message = decode(data[1:], kind)
    except MessageError as error:
        _told(error, kind.__name__)
        return
    assert type(message) is kind
    sent = encode(message)
    assert encode(decode(sent, kind)) == sent, "what goes out does not come back"


def toml(data: bytes) -> None:
    """Read a file of settings."""
    SCRATCH.write_bytes(data)
    _settings((SCRATCH,), {}, ())


def environ(data: bytes) -> None:
    """Read settings from an environment: ``BOARD__PORT=1``, each with our prefix before it."""
    pairs = (os.fsdecode(part).partition("=") for part in data.split(SEPARATOR))
    _settings((), {f"T2__{name}": value for name, _, value in pairs}, ())


def sets(data: bytes) -> None:
    """Read settings from the command line: the words that follow ``--set``."""
    _settings((), {}, [os.fsdecode(part) for part in data.split(SEPARATOR)])


def _settings(files: Sequence[Path], given: Mapping[str, str], words: Sequence[str]) -> None:
    try:
        loaded = load(Everything, Sources(files, given, words))
    except ConfigError as error:
        _told(error, ": ")
        return
    strange = [(path, value) for path, value in flatten(loaded.config) if not _finite(value)]
    assert not strange, f"settings that are no numbers: {strange}"


def _told(error: RobotError, words: str) -> None:
    """A refusal names what is wrong."""
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
