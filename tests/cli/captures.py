"""Generated captures: pcap and pcapng files with UDP packets."""

import io
import socket
from collections.abc import Iterable

from dpkt import ethernet, ip, pcap, pcapng, udp  # type: ignore[import-untyped]

from common.wire.commands import DistanceQuery, MotionCommand, MotionKind
from common.wire.framing import Framing
from common.wire.reports import DistanceReport, VelocityReport

framing = Framing()
RUN = framing.pack(MotionCommand(MotionKind.RUN, 500, 300))
QUERY = framing.pack(DistanceQuery())
VELOCITY = framing.pack(VelocityReport(-250, -15))
DISTANCE = framing.pack(DistanceReport(1234, -905))

PC, BOARD = "10.7.5.220", "10.7.5.224"


def packet(data: bytes, source: str = BOARD, target: str = PC) -> ip.IP:
    """Return an IP packet from port 4002 to port 4001."""
    segment = udp.UDP(sport=4002, dport=4001, data=data)
    segment.ulen = len(segment)
    ends = {"src": socket.inet_aton(source), "dst": socket.inet_aton(target)}
    whole = ip.IP(p=ip.IP_PROTO_UDP, data=segment, **ends)
    whole.len = len(whole)
    return whole


def on_ethernet(network: ip.IP) -> bytes:
    # Padded, as on the cable.
    return bytes(ethernet.Ethernet(type=ethernet.ETH_TYPE_IP, data=network)).ljust(60, b"\0")


def as_pcap(packets: Iterable[bytes], link: int = pcap.DLT_EN10MB) -> bytes:
    return _written(pcap.Writer, packets, link)


def as_pcapng(packets: Iterable[bytes], link: int = pcap.DLT_EN10MB) -> bytes:
    return _written(pcapng.Writer, packets, link)


def _written(writer: type[pcap.Writer], packets: Iterable[bytes], link: int) -> bytes:
    file = io.BytesIO()
    out = writer(file, linktype=link)
    for number, each in enumerate(packets):
        out.writepkt(each, ts=float(number))
    return file.getvalue()
