"""Datagrams from hex, text, pcap and pcapng; errors with file and line."""

import contextlib
import io
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from dpkt import arp, ethernet, pcap, sll, sll2, tcp  # type: ignore[import-untyped]
from hypothesis import given
from hypothesis import strategies as st

from cli.wire import capture
from cli.wire.capture import Datagram
from common.errors import RobotError
from tests.cli.captures import (
    DISTANCE,
    RUN,
    VELOCITY,
    as_pcap,
    as_pcapng,
    on_ethernet,
    packet,
)

ENDS = "10.7.5.224:4002 > 10.7.5.220:4001"


# --- hex ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        "47530800",
        "0x47, 0x53, 0x08, 0x00",
        "47:53-08\n00",
    ],
)
def test_hex_formats(text: str) -> None:
    assert capture.read(text) == [Datagram("", b"GS\x08\x00")]


@pytest.mark.parametrize("text", ["no/such/file", "zz", ""])
def test_neither_hex_nor_file(text: str) -> None:
    with pytest.raises(RobotError, match="is neither hex nor a file"):
        capture.read(text)


def test_text_with_one_datagram_per_line(tmp_path: Path) -> None:
    file = tmp_path / "frames.txt"
    file.write_text("# captured by hand\n4753 # magic\n\n00 01\n", encoding="utf-8")
    assert capture.read(str(file)) == [
        Datagram(f"{file} line 2", b"GS"),
        Datagram(f"{file} line 4", b"\x00\x01"),
    ]


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"47 53\n47 5\n", "^trip line 2: '47 5' is not hex$"),
        (b"# nothing\n", "^trip: contains no hex lines$"),
        (b"\xff\xfe\x00", "^trip: neither pcap, pcapng nor hex text$"),
        (as_pcap([]), "^trip: contains no UDP packets$"),
        (as_pcap([b"x"], 105), "^trip: unsupported link type 105"),
        (as_pcap([on_ethernet(packet(RUN)), b"\x01"]), "^trip: invalid after packet 2"),
    ],
)
def test_unsuitable_content(content: bytes, reason: str) -> None:
    with pytest.raises(RobotError, match=reason):
        capture.from_bytes("trip", content)


def test_standard_input(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"4753")))
    assert [datagram.data for datagram in capture.read("-")] == [b"GS"]


# --- captures -------------------------------------------------------------------------------


@pytest.mark.parametrize("write", [as_pcap, as_pcapng])
def test_the_payload_of_each_udp_packet(write: Callable[..., bytes]) -> None:
    content = write([on_ethernet(packet(VELOCITY)), on_ethernet(packet(DISTANCE + VELOCITY))])
    assert capture.from_bytes("trip", content) == [
        Datagram(f"packet 1 {ENDS}", VELOCITY),
        Datagram(f"packet 2 {ENDS}", DISTANCE + VELOCITY),
    ]


def cooked(network: object) -> bytes:
    return bytes(sll.SLL(ethtype=ethernet.ETH_TYPE_IP, data=network))


def cooked_again(network: object) -> bytes:
    return bytes(sll2.SLL2(ethtype=ethernet.ETH_TYPE_IP, data=network))


@pytest.mark.parametrize(
    ("link", "wrap"),
    [
        (pcap.DLT_LINUX_SLL, cooked),
        (pcap.DLT_LINUX_SLL2, cooked_again),
    ],
)
def test_other_links(link: int, wrap: Callable[[object], bytes]) -> None:
    content = as_pcap([wrap(packet(RUN))], link)
    assert capture.from_bytes("trip", content) == [Datagram(f"packet 1 {ENDS}", RUN)]


def test_other_packets_are_ignored() -> None:
    other = packet(b"")
    other.p, other.data = 6, tcp.TCP()
    arp_packet = bytes(ethernet.Ethernet(type=ethernet.ETH_TYPE_ARP, data=arp.ARP()))
    unknown = bytes(ethernet.Ethernet(type=0x9000, data=b"loop"))
    content = as_pcap([arp_packet, unknown, on_ethernet(other), on_ethernet(packet(RUN))])
    assert [each.where for each in capture.from_bytes("trip", content)] == [f"packet 4 {ENDS}"]


def test_a_missing_library_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "dpkt", None)
    with pytest.raises(RobotError, match="\\[inspect\\]"):
        capture.from_bytes("trip", as_pcap([on_ethernet(packet(RUN))]))


flips = st.lists(st.tuples(st.integers(4, 10_000), st.integers(1, 255)), max_size=3)


@given(st.sampled_from([as_pcap, as_pcapng]), st.integers(4, 10_000), flips)
def test_a_damaged_capture_is_read_or_refused(
    write: Callable[..., bytes], length: int, changes: list[tuple[int, int]]
) -> None:
    """Nothing but ``RobotError`` comes out, and never an empty answer."""
    damaged = bytearray(write([on_ethernet(packet(RUN)), on_ethernet(packet(VELOCITY))])[:length])
    for at, change in changes:
        damaged[4 + at % max(1, len(damaged) - 4) if len(damaged) > 4 else 0] ^= change
    with contextlib.suppress(RobotError):
        assert capture.from_bytes("trip", bytes(damaged))
