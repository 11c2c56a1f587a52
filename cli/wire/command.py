"""``t2 wire``: decoding of captured frames.

``decode`` prints the frames of datagrams; ``identify-crc`` finds their CRC. Both read text with hex
lines, pcap and pcapng; ``decode`` also reads a hex string.
"""

import argparse

from cli.inspect import output
from cli.wire import capture, crc
from cli.wire.decode import SENDERS, Bad, as_json, as_text, parts
from common.cli_args import add_sources, sources
from common.config import load
from common.errors import RobotError
from common.settings import Shared, Wire
from common.wire.framing import Framing


class WireConfig(Shared, frozen=True, kw_only=True):
    """The configuration sections for decoding."""

    wire: Wire = Wire()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the two subcommands."""
    tools = parser.add_subparsers(dest="tool", required=True, metavar="TOOL")
    text = "print frames, one per line, with the reason for each invalid run of bytes"
    decode = tools.add_parser("decode", help=text, description=text)
    decode.add_argument("source", metavar="HEX|FILE|-", help="hex, a pcap, hex lines, or stdin")
    decode.add_argument("--from", dest="sender", choices=SENDERS, default="both")
    decode.add_argument("--json", action="store_true", help="one JSON object per line")
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
        for part in parts(framing, datagram.data, options.sender):
            bad += isinstance(part, Bad)
            if options.json:
                output.line(as_json(part, datagram.where))
            else:
                print(f"{datagram.where} {as_text(part, wire)}".lstrip())
    return 1 if bad else 0


def identify_crc(options: argparse.Namespace) -> int:
    """Print the matching CRCs with their numbers of frames."""
    datagrams = capture.read(options.source)
    findings = crc.identify(crc.frames(datagram.data for datagram in datagrams))
    if not findings.frames:
        raise RobotError(f"{options.source}: contains no frame: the magic 47 53 is missing")
    print("\n".join(crc.report(findings)))
    return 0 if findings.nonzero and findings.answers else 1
