"""``t2 wire decode``: captured frames as text.

The source is hex on the command line, which is one datagram, or a file, pcap or pcapng. Spaces,
colons, commas, dashes and 0x are ignored in hex. A pcapng file is read with the link type of its
first interface.

The same id means one frame from the PC and another one from the board. The sizes differ, except for
the two emergency brake switches. So each frame is decoded for both senders.
"""

import argparse
import io
import re
from collections.abc import Iterator
from enum import IntEnum
from pathlib import Path
from typing import Any, get_args

import msgspec

from cli.settings import Everything
from common.cli_args import add_sources, sources
from common.config import load
from common.errors import RobotError
from common.messages import SONAR_NAMES, FaultName
from common.settings import AngularUnit, Wire
from common.wire import framing
from common.wire.commands import TO_BOARD, MotionCommand
from common.wire.frame import Frame, Kinds
from common.wire.framing import Reason, Received, Rejected
from common.wire.reports import FROM_BOARD, SONAR_FAULT_MM

TABLES: dict[str, Kinds] = {"pc": TO_BOARD, "board": FROM_BOARD}

# If no sender matches, the reason of the latest check is the most useful one.
FURTHEST = (
    Reason.BAD_VALUE, Reason.BAD_CRC, Reason.TRUNCATED, Reason.BAD_SIZE,
    Reason.UNKNOWN_ID, Reason.NO_MAGIC,
)  # fmt: skip

UNITS = {"_mmps": "mm/s", "_mm": "mm", "_ddeg": "deg", "_raw": ""}
Datagram = tuple[str, bytes]  # its place in the source, its bytes


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the subcommand."""
    tools = parser.add_subparsers(dest="tool", required=True, metavar="TOOL")
    text = "print frames, one per line, with the reason for each invalid run of bytes"
    decode = tools.add_parser("decode", help=text, description=text)
    decode.add_argument("source", metavar="HEX|FILE", help="hex, or a capture (pcap, pcapng)")
    add_sources(decode)


def run(options: argparse.Namespace) -> int:
    """Print the frames of the datagrams; return 1 if a run of bytes is invalid."""
    wire = load(Everything, sources(options)).config.wire
    bad = 0
    for where, data in datagrams(options.source):
        offset = 0
        for part in parts(data):
            bad += isinstance(part, Rejected)
            print(f"{where} +{offset:<4} {as_text(part, wire)}".strip())
            offset += size_of(part)
    return 1 if bad else 0


# --- datagrams ----------------------------------------------------------------------------------


def datagrams(source: str) -> list[Datagram]:
    """Return the datagrams of a hex string or of a capture; raise ``RobotError`` without any."""
    try:
        data = bytes.fromhex(re.sub(r"0[xX]|[\s:,-]", "", source))
    except ValueError:
        data = b""
    if data:
        return [("", data)]
    try:
        content = Path(source).read_bytes()
    except OSError as error:
        raise RobotError(f"{source!r} is neither hex nor a file: {error.strerror}") from None
    found = list(from_pcap(source, content))
    if not found:
        raise RobotError(f"{source}: contains no UDP packets")
    return found


def from_pcap(name: str, content: bytes) -> Iterator[Datagram]:
    """Yield the payload of each UDP packet; raise ``RobotError`` at the first invalid one."""
    try:
        from dpkt import dpkt, ethernet, ip, pcap, sll, sll2, udp, utils  # type: ignore[import-untyped]
    except ImportError:
        raise RobotError(
            "reading a capture needs dpkt; `make` installs it, or pip install -e '.[inspect]'"
        ) from None
    links = {
        pcap.DLT_EN10MB: ethernet.Ethernet,
        pcap.DLT_LINUX_SLL: sll.SLL,  # of `tcpdump -i any`
        pcap.DLT_LINUX_SLL2: sll2.SLL2,
    }
    number = 0
    try:
        reader = pcap.UniversalReader(io.BytesIO(content))
        if reader.datalink() not in links:
            raise RobotError(
                f"{name}: unsupported link type {reader.datalink()}; capture on Ethernet"
            )
        for number, (_, packet) in enumerate(reader, 1):
            network = links[reader.datalink()](packet)
            while not isinstance(network, (ip.IP, bytes)):
                network = network.data
            if not isinstance(network, bytes) and isinstance(network.data, udp.UDP):
                segment = network.data
                source = f"{utils.inet_to_str(network.src)}:{segment.sport}"
                target = f"{utils.inet_to_str(network.dst)}:{segment.dport}"
                yield f"packet {number} {source} > {target}", bytes(segment.data)
    except (dpkt.Error, ValueError, KeyError) as error:
        raise RobotError(f"{name}: invalid after packet {number}: {error}") from None


# --- frames -------------------------------------------------------------------------------------

Good = dict[str, Received]  # the frame by its possible senders


def parts(data: bytes) -> Iterator[Good | Rejected]:
    """Yield the frames and the invalid runs in order; together they contain all bytes."""
    offset = 0
    while offset < len(data):
        read = {name: framing.part_at(offset, data, kinds) for name, kinds in TABLES.items()}
        good = {name: part for name, part in read.items() if isinstance(part, Received)}
        bad = [part for part in read.values() if isinstance(part, Rejected)]
        part: Good | Rejected = good
        if not good:
            part = min(bad, key=lambda each: FURTHEST.index(each.reason))
        yield part
        offset += size_of(part)


def size_of(part: Good | Rejected) -> int:
    """Return the number of bytes; a frame has the same bytes from each sender."""
    return len(part.raw if isinstance(part, Rejected) else next(iter(part.values())).raw)


def as_text(part: Good | Rejected, wire: Wire) -> str:
    """Return a part as one line."""
    if isinstance(part, Rejected):
        return f"BAD {part.reason}: {part.detail}: {part.raw.hex()}"
    frames: list[Frame] = [received.frame for received in part.values()]
    names = " or ".join(type(frame).__name__ for frame in frames)
    frame = frames[0]  # frames of two senders have the same fields
    commands = isinstance(frame, MotionCommand)
    unit = wire.command_angular_unit if commands else wire.feedback_angular_unit
    fields = msgspec.structs.asdict(frame).items()
    texts = [_text(name, value, unit) for name, value in fields]
    return f"{' or '.join(part):<5} {names} {', '.join(texts)}".rstrip()


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
