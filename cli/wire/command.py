"""``t2 wire``: read captured frames.

``decode`` prints what datagrams hold; ``identify-crc`` says which CRC they carry. Both take hex, a
text of hex lines, pcap and pcapng.
"""

import argparse
import json

from cli.wire import capture, crc
from cli.wire.decode import SENDERS, Bad, as_table, as_text, parts
from common.cli_args import add_sources, sources
from common.config import load
from common.errors import RobotError
from common.settings import Shared, Wire
from common.wire.framing import Framing


class WireConfig(Shared, frozen=True, kw_only=True):
    """The sections that reading frames needs."""

    wire: Wire = Wire()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the two subcommands."""
    tools = parser.add_subparsers(dest="tool", required=True, metavar="TOOL")
    text = "print frames, one a line, with the reason for each bad run of bytes"
    decode = tools.add_parser("decode", help=text, description=text)
    decode.add_argument("source", metavar="HEX|FILE|-", help="hex, a pcap, hex lines, or stdin")
    decode.add_argument("--from", dest="sender", choices=SENDERS, default="both")
    decode.add_argument("--json", action="store_true", help="one JSON object a line")
    add_sources(decode)
    text = "say which 16-bit CRC captured frames carry"
    identify = tools.add_parser("identify-crc", help=text, description=text)
    identify.add_argument("source", metavar="FILE|-", help="a pcap or hex lines")


def run(options: argparse.Namespace) -> int:
    """Run the subcommand; 1 if a byte run is bad or no CRC was found."""
    return decode(options) if options.tool == "decode" else identify_crc(options)


def decode(options: argparse.Namespace) -> int:
    """Print what the datagrams hold."""
    wire = load(WireConfig, sources(options)).config.wire
    framing = Framing(wire.crc, wire.crc_covers)
    bad = 0
    for datagram in capture.read(options.source):
        for part in parts(framing, datagram.data, options.sender):
            bad += isinstance(part, Bad)
            if options.json:
                print(json.dumps(as_table(part, datagram.where)))
            else:
                print(f"{datagram.where} {as_text(part, wire)}".lstrip())
    return 1 if bad else 0


def identify_crc(options: argparse.Namespace) -> int:
    """Print which CRCs fit how many frames."""
    datagrams = capture.read(options.source)
    findings = crc.identify(crc.frames(datagram.data for datagram in datagrams))
    if not findings.frames:
        raise RobotError(f"{options.source}: has no frame: nothing starts with 47 53")
    print("\n".join(crc.report(findings)))
    return 0 if findings.telling and findings.answers else 1
