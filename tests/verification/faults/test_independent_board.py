"""The independent board by golden bytes."""

import contextlib
import io
import json
import math
import socket
import time
from collections.abc import Iterator

import pytest

from verification.faults.independent_board import BUMPER, IndependentBoard, crc16, frame, frames
from verification.harness.ports import udp_ports

# What the public ROS 1 driver of this vehicle sends; m/s, degrees/s.
MOTIONS = {
    "47530d00267400000000000000": ("stop", 0, 0),
    "47530d002674833001f4012c01": ("run", 0.5, 30),
    "47530d002674837801f4812c81": ("run", -0.5, -30),
    "47530d00267479c00200000000": ("brake", 0, 0),
}
ANSWERS = {  # of a board that stands, with its bumper pressed
    "4753080000760000": "4753100000760000" + 8 * "00",
    "4753080001760000": "475318000176b34c" + 8 * "204e",
    "4753080002760000": "475309000276c1c001",
    "475309000476c1c001": "475309000476c1c001",
    "475309000576000000": "47530d000576" + "0000" + "00" + 4 * "00",
    "475309000576c1c001": "47530d000576" + "3dc0" + "01" + 4 * "00",
}


class Host:
    """The PC's end of the link."""

    def __init__(self, board_port: int, port: int) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", port))
        self.socket.connect(("127.0.0.1", board_port))
        self.socket.settimeout(5.0)

    def answer(self, command: int) -> bytes:
        """Return the next datagram with this id."""
        while True:
            datagram = self.socket.recv(2048)
            if int.from_bytes(datagram[4:6], "little") == command:
                return datagram


Ends = tuple[IndependentBoard, Host]


@pytest.fixture
def trace() -> io.StringIO:
    return io.StringIO()


@pytest.fixture
def ends(trace: io.StringIO) -> Iterator[Ends]:
    port, first, second = udp_ports(3)
    host = Host(port, first)
    with (
        contextlib.closing(host.socket),
        contextlib.closing(IndependentBoard(port, (first, second), trace)) as board,
    ):
        yield board, host


def test_the_crc_is_crc_16_arc() -> None:
    assert crc16(b"123456789") == 0xBB3D


@pytest.mark.parametrize(("sent", "command"), MOTIONS.items())
def test_motion_commands(
    ends: Ends,
    trace: io.StringIO,
    sent: str,
    command: tuple[str, int, int],
) -> None:
    ends[1].socket.send(bytes.fromhex(sent))
    end_s = time.monotonic() + 5.0
    while not trace.getvalue() and time.monotonic() < end_s:
        time.sleep(0.001)
    (line,) = map(json.loads, trace.getvalue().splitlines())
    found = line["kind"], line["linear"], round(math.degrees(line["angular"]), 6)
    assert found == command


@pytest.mark.parametrize(("sent", "answer"), ANSWERS.items())
def test_answers(ends: Ends, sent: str, answer: str) -> None:
    board, host = ends
    board.press("1", "0")
    host.socket.send(bytes.fromhex(sent))
    command = int.from_bytes(bytes.fromhex(sent)[4:6], "little")
    assert host.answer(command).hex() == answer


def test_the_velocity_comes_unasked(ends: Ends) -> None:
    board, host = ends
    board.linear, board.angular = -0.5, -0.5236
    while (datagram := host.answer(0x7426)).hex().endswith("00000000"):
        pass
    linear, angular = datagram[8:10], datagram[10:12]
    assert linear[1] & angular[1] & 0x80
    assert 0 < int.from_bytes(linear, "little") & 0x7FFF <= 500
    assert 0 < int.from_bytes(angular, "little") & 0x7FFF <= 300


def test_a_damaged_frame_ends_a_datagram() -> None:
    good, bad = frame(BUMPER, b"\x00"), frame(BUMPER, b"\x01")[:-1] + b"\x02"
    assert list(frames(good + good + bad + good)) == [(BUMPER, b"\x00")] * 2
