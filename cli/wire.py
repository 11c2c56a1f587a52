"""``t2 wire decode``: captured frames as text.

The source is hex on the command line, which is one datagram, or a file of `tcpdump -w`. Spaces,
colons, commas, dashes and 0x are ignored in hex.

The same id means one frame from the PC and another one from the board. The sizes differ, except for
the two emergency brake switches. So each frame is decoded for both senders.
"""

import argparse
import re
import struct
from collections.abc import Iterator
from enum import IntEnum
from ipaddress import IPv4Address
from pathlib import Path
from typing import Any, get_args

import msgspec

from common.errors import RobotError
from common.messages import FaultName
from common.wire import framing
from common.wire.commands import TO_BOARD
from common.wire.frame import Frame, Kinds
from common.wire.framing import Reason, Received, Rejected
from common.wire.reports import FROM_BOARD

TABLES: dict[str, Kinds] = {"pc": TO_BOARD, "board": FROM_BOARD}

# If no sender matches, the reason of the latest check is the most useful one.
FURTHEST = (
    Reason.BAD_VALUE, Reason.BAD_CRC, Reason.TRUNCATED, Reason.BAD_SIZE,
    Reason.UNKNOWN_ID, Reason.NO_MAGIC,
)  # fmt: skip

PCAP = (b"\xd4\xc3\xb2\xa1", b"\x4d\x3c\xb2\xa1")  # of `tcpdump -w`: microseconds, nanoseconds
# Bytes before the IP packet by link type: Ethernet, and both of `tcpdump -i any`.
LINKS = {1: 14, 113: 16, 276: 20}
FILE_HEADER, PACKET_HEADER, IP_HEADER, UDP_HEADER = 24, 16, 20, 8
PROTOCOL_UDP = 17

Datagram = tuple[str, bytes]  # its place in the source, its bytes


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the subcommand."""
    tools = parser.add_subparsers(dest="tool", required=True, metavar="TOOL")
    text = "print frames, one per line, with the reason for each invalid run of bytes"
    decode = tools.add_parser("decode", help=text, description=text)
    decode.add_argument("source", metavar="HEX|FILE", help="hex, or a capture of `tcpdump -w`")


def run(options: argparse.Namespace) -> int:
    """Print the frames of the datagrams; return 1 if a run of bytes is invalid."""
    bad = 0
    for where, data in datagrams(options.source):
        for offset, part in parts(data):
            bad += isinstance(part, Rejected)
            print(f"{where} +{offset:<4} {as_text(part)}".strip())
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
    """Yield the payload of each UDP packet over IPv4; raise ``RobotError`` for another file."""
    link = LINKS.get(int.from_bytes(content[20:24], "little"))
    if content[:4] not in PCAP or link is None:
        raise RobotError(
            f"{name} is not a pcap file of Ethernet: capture with `tcpdump -w FILE`, or convert it "
            "with `editcap -F pcap`"
        )
    number, offset = 0, FILE_HEADER
    while offset + PACKET_HEADER <= len(content):
        number += 1
        start = offset + PACKET_HEADER
        offset = start + int.from_bytes(content[offset + 8 : offset + 12], "little")
        packet = content[start + link : offset]
        if len(packet) < IP_HEADER or packet[0] >> 4 != 4 or packet[9] != PROTOCOL_UDP:
            continue
        udp = packet[4 * (packet[0] & 0xF) :]  # after the options of IP
        if len(udp) >= UDP_HEADER:
            source, target, size = struct.unpack(">HHH", udp[:6])
            ends = f"{IPv4Address(packet[12:16])}:{source} > {IPv4Address(packet[16:20])}:{target}"
            yield f"packet {number} {ends}", udp[UDP_HEADER:size]


# --- frames -------------------------------------------------------------------------------------

Good = dict[str, Received]  # the frame by its possible senders


def parts(data: bytes) -> Iterator[tuple[int, Good | Rejected]]:
    """Yield the frames and the invalid runs with their offsets; together they contain all bytes."""
    offset = 0
    while offset < len(data):
        read = {name: framing.part_at(offset, data, kinds) for name, kinds in TABLES.items()}
        good = {name: part for name, part in read.items() if isinstance(part, Received)}
        bad = [part for part in read.values() if isinstance(part, Rejected)]
        if good:
            yield offset, good
            offset += len(next(iter(good.values())).raw)  # the same bytes from each sender
        else:
            worst = min(bad, key=lambda each: FURTHEST.index(each.reason))
            yield offset, worst
            offset += len(worst.raw)


def as_text(part: Good | Rejected) -> str:
    """Return a part as one line; fields are raw, in the units of the manual."""
    if isinstance(part, Rejected):
        return f"BAD {part.reason}: {part.detail}: {part.raw.hex()}"
    frames: list[Frame] = [received.frame for received in part.values()]
    names = " or ".join(type(frame).__name__ for frame in frames)
    fields = msgspec.structs.asdict(frames[0]).items()  # frames of two senders have the same fields
    texts = [f"{name}={_text(name, value)}" for name, value in fields]
    return f"{' or '.join(part):<5} {names} {' '.join(texts)}".rstrip()


def _text(name: str, value: Any) -> str:
    if name == "fault_bits":
        return ",".join([f"0x{value:08x}", *_faults(value)])
    if isinstance(value, tuple):
        return ",".join(map(str, value))
    return value.name if isinstance(value, IntEnum) else str(value)


def _faults(bits: int) -> list[str]:
    names = get_args(FaultName)
    return [
        names[bit] if bit < len(names) else f"bit_{bit}" for bit in range(32) if bits >> bit & 1
    ]
