"""``t2 wire decode``: captures and hex, frames as text, the reasons of invalid runs, errors."""

import io
from pathlib import Path

import pytest
from dpkt import arp, ethernet, pcap, pcapng, sll, sll2, tcp, udp  # type: ignore[import-untyped]
from dpkt import ip as ipv4
from hypothesis import given
from hypothesis import strategies as st

from cli.__main__ import main
from cli.wire import as_text, datagrams, from_pcap, parts
from common.wire import commands as c
from common.wire import framing
from common.wire import reports as r
from common.wire.frame import Frame, Side
from common.wire.framing import Rejected
from t2.errors import T2Error
from verification.harness.frame_examples import COMMANDS, REPORTS

RUN = framing.pack(c.MotionCommand(c.MotionKind.RUN, 500, 300))
QUERY = framing.pack(c.DistanceQuery())
VELOCITY = framing.pack(r.VelocityReport(-250, -15))
DISTANCE = framing.pack(r.DistanceReport(1234, -905))
ENDS = "10.7.5.224:4002 > 10.7.5.220:4001"

# --- datagrams ------------------------------------------------------------------------------


def packet(data: bytes) -> ipv4.IP:
    """Return a packet from the board to the PC."""
    segment = udp.UDP(sport=4002, dport=4001, data=data)
    segment.ulen = len(segment)
    whole = ipv4.IP(
        p=ipv4.IP_PROTO_UDP, data=segment, src=bytes([10, 7, 5, 224]), dst=bytes([10, 7, 5, 220])
    )
    whole.len = len(whole)
    return whole


def on_ethernet(network: ipv4.IP) -> bytes:
    # Padded, as on the cable.
    return bytes(ethernet.Ethernet(type=ethernet.ETH_TYPE_IP, data=network)).ljust(60, b"\0")


def as_pcap(*packets: bytes, link: int = pcap.DLT_EN10MB, writer: type = pcap.Writer) -> bytes:
    file = io.BytesIO()
    out = writer(file, linktype=link)
    for number, each in enumerate(packets):
        out.writepkt(each, ts=float(number))
    return file.getvalue()


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"no capture", "trip: invalid after packet 0"),
        (as_pcap(), "trip: contains no UDP packets$"),
        (as_pcap(b"x", link=105), "trip: unsupported link type 105"),
        (as_pcap(on_ethernet(packet(RUN)), b"\x01"), "trip: invalid after packet 2"),
    ],
)
def test_unsuitable_content(content: bytes, reason: str, tmp_path: Path) -> None:
    file = tmp_path / "trip"
    file.write_bytes(content)
    with pytest.raises(T2Error, match=reason):
        datagrams(str(file))


OTHER = packet(b"")
OTHER.p, OTHER.data = 6, tcp.TCP()
COOKED = {"ethtype": ethernet.ETH_TYPE_IP, "data": packet(RUN)}  # of `tcpdump -i any`
MIXED = (
    bytes(ethernet.Ethernet(type=ethernet.ETH_TYPE_ARP, data=arp.ARP())),
    bytes(ethernet.Ethernet(type=0x9000, data=b"loop")),
    on_ethernet(OTHER),
    on_ethernet(packet(RUN)),
)


@pytest.mark.parametrize(
    ("content", "number"),
    [
        (as_pcap(on_ethernet(packet(RUN)), writer=pcapng.Writer), 1),
        (as_pcap(bytes(sll.SLL(**COOKED)), link=pcap.DLT_LINUX_SLL), 1),
        (as_pcap(bytes(sll2.SLL2(**COOKED)), link=pcap.DLT_LINUX_SLL2), 1),
        (as_pcap(*MIXED), 4),
    ],
)
def test_the_payload_of_each_udp_packet(content: bytes, number: int) -> None:
    assert list(from_pcap("trip", content)) == [(f"packet {number} {ENDS}", RUN)]


# --- the command line -----------------------------------------------------------------------


def test_decode_prints_one_line_per_frame(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["wire", "decode", f"0x{RUN.hex(':')}, {QUERY.hex('-')}\n"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "+0    pc    MotionCommand kind=RUN linear_mmps=500 angular_raw=300",
        "+13   pc    DistanceQuery",
    ]
    corrupted = DISTANCE[:-1] + bytes([DISTANCE[-1] ^ 1])
    assert main(["wire", "decode", (RUN + b"\1\2" + QUERY + corrupted).hex()]) == 1
    _, bad, query, crc = capsys.readouterr().out.splitlines()
    assert bad == "+13   BAD no_magic: does not start with 47 53: 0102"
    assert query == "+15   pc    DistanceQuery"
    assert "BAD bad_crc: header says 0x" in crc  # and not the wrong size of a query
    file = tmp_path / "trip.pcap"
    file.write_bytes(as_pcap(on_ethernet(packet(VELOCITY + DISTANCE))))
    assert main(["wire", "decode", str(file)]) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith(f"packet 1 {ENDS} +0    board Velocity")
    assert "+12   board DistanceReport distance_mm=1234 heading_ddeg=-905" in second
    for text in ("no/such/file", ""):
        assert main(["wire", "decode", text]) == 1
        assert f"t2 wire: {text!r} is neither hex nor a file: " in capsys.readouterr().err


# --- frames as text -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("frame", "text"),
    [
        (r.UltrasonicReport((1, 2, 3, 4, 5, 6, 0xFFFF, 8)),
         "board UltrasonicReport ranges_mm=1,2,3,4,5,6,65535,8"),
        (r.BumperBrakeReport(False), "pc or board BumperBrakeSet or BumperBrakeReport on=False"),
        (r.DriverReport(Side.LEFT, 0x80000011),
         "board DriverReport side=LEFT fault_bits=0x80000011,over_current,overload,bit_31"),
    ],
)  # fmt: skip
def test_a_frame_as_text(frame: Frame, text: str) -> None:
    assert [as_text(part) for _, part in parts(framing.pack(frame))] == [text]


@given(st.lists(st.sampled_from([*COMMANDS, *REPORTS]).map(framing.pack) | st.binary(max_size=9)))
def test_every_byte_is_in_a_part(pieces: list[bytes]) -> None:
    whole, covered = b"".join(pieces), 0
    for offset, part in parts(whole):
        assert offset == covered
        assert as_text(part)
        covered += len(part.raw if isinstance(part, Rejected) else next(iter(part.values())).raw)
    assert covered == len(whole)
