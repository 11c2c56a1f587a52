"""``t2 wire``: decoding of captured frames.

``decode`` prints the frames of datagrams; ``identify-crc`` finds their CRC. Both read text with hex
lines, pcap and pcapng; ``decode`` also reads a hex string.

The same id means one frame from the PC and another one from the board. The sizes differ, except for
the two emergency brake switches. So each frame is decoded for both senders.
"""

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, get_args

import msgspec

from cli.wire import capture, crc
from common.cli_args import add_sources, sources
from common.config import load
from common.errors import RobotError
from common.messages import SONAR_NAMES, FaultName
from common.settings import AngularUnit, Shared, Wire
from common.wire.commands import TO_BOARD, MotionCommand
from common.wire.frame import Frame, Kinds
from common.wire.framing import Framing, Reason, Received, Rejected
from common.wire.reports import FROM_BOARD, SONAR_FAULT_MM

TABLES: dict[str, Kinds] = {"pc": TO_BOARD, "board": FROM_BOARD}

# If no sender matches, the reason of the latest check is the most useful one.
FURTHEST = (
    Reason.BAD_VALUE, Reason.BAD_CRC, Reason.TRUNCATED, Reason.BAD_SIZE,
    Reason.UNKNOWN_ID, Reason.NO_MAGIC,
)  # fmt: skip

UNITS = {"_mmps": "mm/s", "_mm": "mm", "_ddeg": "deg", "_raw": ""}


class WireConfig(Shared, frozen=True, kw_only=True):
    """The configuration sections for decoding."""

    wire: Wire = Wire()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the two subcommands."""
    tools = parser.add_subparsers(dest="tool", required=True, metavar="TOOL")
    text = "print frames, one per line, with the reason for each invalid run of bytes"
    decode = tools.add_parser("decode", help=text, description=text)
    decode.add_argument("source", metavar="HEX|FILE|-", help="hex, a pcap, hex lines, or stdin")
    add_sources(decode)
    text = "find the 16-bit CRC of captured frames"
    identify = tools.add_parser("identify-crc", help=text, description=text)
    identify.add_argument("source", metavar="FILE|-", help="a pcap or hex lines")


def run(options: argparse.Namespace) -> int:
    """Run the subcommand; return 1 if a run of bytes is invalid or no CRC was found."""
    return decode(options) if options.tool == "decode" else identify_crc(options)


def decode(options: argparse.Namespace) -> int:
    """Print the frames of the datagrams."""
    wire = load(WireConfig, sources(options)).config.wire
    framing = Framing(wire.crc, wire.crc_covers)
    bad = 0
    for datagram in capture.read(options.source):
        for part in parts(framing, datagram.data):
            bad += isinstance(part, Bad)
            print(f"{datagram.where} {as_text(part, wire)}".lstrip())
    return 1 if bad else 0


def identify_crc(options: argparse.Namespace) -> int:
    """Print the matching CRCs with their numbers of frames."""
    datagrams = capture.read(options.source)
    frames = list(crc.frames(datagram.data for datagram in datagrams))
    if not frames:
        raise RobotError(f"{options.source}: contains no frame: the magic 47 53 is missing")
    fits = crc.identify(frames)
    for fit in fits:
        print(f"{fit.crc} over {fit.covers}: matches {fit.frames} of {len(frames)}")
    text, found = crc.verdict(fits, len(frames))
    print(text)
    return 0 if found else 1


@dataclass(frozen=True, slots=True)
class Good:
    """A frame with its possible senders."""

    offset: int
    raw: bytes
    frames: dict[str, Frame]  # by sender


@dataclass(frozen=True, slots=True)
class Bad:
    """An invalid run of bytes with the reason."""

    offset: int
    raw: bytes
    reason: Reason
    detail: str


def parts(framing: Framing, datagram: bytes) -> Iterator[Good | Bad]:
    """Yield the parts of a datagram in order; together they contain all its bytes."""
    offset = 0
    while offset < len(datagram):
        read = {name: framing.part_at(offset, datagram, kinds) for name, kinds in TABLES.items()}
        part = _best(offset, read)
        yield part
        offset += len(part.raw)


def _best(offset: int, read: Mapping[str, Received | Rejected]) -> Good | Bad:
    good = {name: part for name, part in read.items() if isinstance(part, Received)}
    if good:
        raw = next(iter(good.values())).raw
        return Good(offset, raw, {name: part.frame for name, part in good.items()})
    bad = [part for part in read.values() if isinstance(part, Rejected)]
    worst = min(bad, key=lambda part: FURTHEST.index(part.reason))
    return Bad(offset, worst.raw, worst.reason, worst.detail)


def as_text(part: Good | Bad, wire: Wire) -> str:
    """Return a part as one line."""
    if isinstance(part, Bad):
        return f"+{part.offset:<4} BAD {part.reason}: {part.detail}: {part.raw.hex()}"
    senders = " or ".join(part.frames)
    names = " or ".join(type(frame).__name__ for frame in part.frames.values())
    frame = next(iter(part.frames.values()))  # frames of two senders have the same fields
    commands = isinstance(frame, MotionCommand)
    unit = wire.command_angular_unit if commands else wire.feedback_angular_unit
    fields = msgspec.structs.asdict(frame).items()
    texts = [_text(name, value, unit) for name, value in fields]
    return f"+{part.offset:<4} {senders:<5} {names} {', '.join(texts)}".rstrip()


def _text(name: str, value: Any, unit: AngularUnit) -> str:
    if name == "angular_raw":
        if unit == "milliradian":
            return f"angular {value / 1000:.3f} rad/s"
        return f"angular {value / 10:.1f} deg/s"
    if name == "ranges_mm":
        shown = ("fault" if range_ == SONAR_FAULT_MM else str(range_) for range_ in value)
        pairs = zip(SONAR_NAMES, shown, strict=True)
        return " ".join(f"{place}={text}" for place, text in pairs) + " mm"
    if name == "fault_bits":
        return f"faults 0x{value:08x} {' '.join(_faults(value))}".rstrip()
    if isinstance(value, IntEnum):
        return f"{name} {value.name}"
    return _number(name, value)


def _number(name: str, value: int) -> str:
    for suffix, unit in UNITS.items():
        if name.endswith(suffix):
            shown = f"{value / 10:.1f}" if suffix == "_ddeg" else str(value)
            return f"{name.removesuffix(suffix)} {shown} {unit}"
    if isinstance(value, bool):
        return f"{name} {'yes' if value else 'no'}"
    return f"{name} {value}"


def _faults(bits: int) -> list[str]:
    names = get_args(FaultName)
    return [
        names[bit] if bit < len(names) else f"bit_{bit}" for bit in range(32) if bits >> bit & 1
    ]
