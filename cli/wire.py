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
from msgspec.structs import replace

from common.wire import framing
from common.wire.commands import TO_BOARD
from common.wire.frame import Frame, Kinds
from common.wire.framing import Reason, Received, Rejected
from common.wire.reports import FROM_BOARD
from t2.errors import T2Error
from t2.messages import FaultName

TABLES: dict[str, Kinds] = {"pc": TO_BOARD, "board": FROM_BOARD}

# If no sender matches, the reason of the latest check is the most useful one.
FURTHEST = (
    Reason.BAD_VALUE, Reason.BAD_CRC, Reason.TRUNCATED, Reason.BAD_SIZE,
    Reason.UNKNOWN_ID, Reason.NO_MAGIC,
)  # fmt: skip

Datagram = tuple[str, bytes]  # its place in the source, its bytes


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the subcommand."""
    tools = parser.add_subparsers(dest="tool", required=True, metavar="TOOL")
    text = "print frames, one per line, with the reason for each invalid run of bytes"
    decode = tools.add_parser("decode", help=text, description=text)
    decode.add_argument("source", metavar="HEX|FILE", help="hex, or a capture (pcap, pcapng)")


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
    """Return the datagrams of a hex string or of a capture; raise ``T2Error`` without any."""
    try:
        data = bytes.fromhex(re.sub(r"0[xX]|[\s:,-]", "", source))
    except ValueError:
        data = b""
    if data:
        return [("", data)]
    try:
        content = Path(source).read_bytes()
    except OSError as error:
        raise T2Error(f"{source!r} is neither hex nor a file: {error.strerror}") from None
    found = list(from_pcap(source, content))
    if not found:
        raise T2Error(f"{source}: contains no UDP packets")
    return found


def from_pcap(name: str, content: bytes) -> Iterator[Datagram]:
    """Yield the payload of each UDP packet; raise ``T2Error`` at the first invalid one."""
    try:
        from dpkt import dpkt, ethernet, ip, pcap, sll, sll2, udp, utils  # type: ignore[import-untyped]
    except ImportError:
        raise T2Error(
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
            raise T2Error(f"{name}: unsupported link type {reader.datalink()}; capture on Ethernet")
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
        raise T2Error(f"{name}: invalid after packet {number}: {error}") from None


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
            raw = min((each.raw for each in bad), key=len)  # up to a frame of either sender
            yield offset, replace(worst, raw=raw)
            offset += len(raw)


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
