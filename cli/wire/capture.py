"""Reader of captured datagrams: hex text, or UDP packets of a pcap or pcapng file.

Hex on the command line is one datagram; a text file has one per line. Spaces, colons, commas,
dashes and 0x are ignored, and comments after #. A pcapng file is read with the link type of its
first interface.
"""

import io
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from common.errors import RobotError

PCAP_MAGICS = tuple(
    bytes.fromhex(magic)
    for magic in ("a1b2c3d4", "d4c3b2a1", "a1b23c4d", "4d3cb2a1", "0a0d0d0a")  # the last: pcapng
)


@dataclass(frozen=True, slots=True)
class Datagram:
    """The bytes of one datagram and their place in the source."""

    where: str
    data: bytes


def read(source: str) -> list[Datagram]:
    """Return the datagrams of ``-`` (standard input), a file, or a hex string."""
    if source == "-":
        return from_bytes("standard input", sys.stdin.buffer.read())
    data = _hex(source)
    if data:
        return [Datagram("", data)]
    try:
        return from_bytes(source, Path(source).read_bytes())
    except OSError as error:
        raise RobotError(f"{source!r} is neither hex nor a file: {error.strerror}") from None


def from_bytes(name: str, content: bytes) -> list[Datagram]:
    """Return the datagrams of a capture, or of a text with hex lines."""
    if content.startswith(PCAP_MAGICS):
        datagrams = list(_from_pcap(name, content))
        kind = "UDP packets"
    else:
        try:
            text = content.decode()
        except UnicodeDecodeError:
            raise RobotError(f"{name}: neither pcap, pcapng nor hex text") from None
        datagrams = _from_text(name, text)
        kind = "hex lines"
    if not datagrams:
        raise RobotError(f"{name}: contains no {kind}")
    return datagrams


def _from_text(name: str, text: str) -> list[Datagram]:
    datagrams = []
    for number, line in enumerate(text.splitlines(), 1):
        where = f"{name} line {number}"
        data = _hex(line.partition("#")[0])
        if data is None:
            raise RobotError(f"{where}: {line.strip()[:40]!r} is not hex")
        if data:
            datagrams.append(Datagram(where, data))
    return datagrams


def _hex(text: str) -> bytes | None:
    digits = re.sub(r"0[xX]|[\s:,-]", "", text)
    try:
        return bytes.fromhex(digits)
    except ValueError:
        return None


def _from_pcap(name: str, content: bytes) -> Iterator[Datagram]:
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
                yield Datagram(f"packet {number} {source} > {target}", bytes(segment.data))
    except (dpkt.Error, ValueError, KeyError) as error:
        raise RobotError(f"{name}: invalid after packet {number}: {error}") from None
