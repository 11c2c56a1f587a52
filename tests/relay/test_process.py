"""The relay as a process, between plain UDP sockets."""

import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from services.relay import wire
from services.relay.__main__ import EXIT_CONFIG, EXIT_LINK, main
from tests.relay.frames import CLEAR, HIT, QUERY, RUN, STOP
from tests.relay.relay_fixture import (
    BOARD_SIDE,
    PC_SIDE,
    STRANGER,
    RunningRelay,
    drain,
    received,
    running_relay,
    udp,
    wait_for,
)
from verification.harness.waiting import wait_until


@pytest.fixture
def relay(tmp_path: Path) -> Iterator[RunningRelay]:
    with running_relay(tmp_path) as it:
        wait_for(it.board, wire.BRAKE)
        yield it


def pass_commands(relay: RunningRelay) -> None:
    """Send neutral commands until one passes."""

    def passes() -> bool:
        relay.to_board(STOP)
        return STOP in received(relay.board, 0.01)

    wait_until(passes, "a STOP at the board")


def test_it_passes_both_ways_port_by_port_byte_for_byte(relay: RunningRelay) -> None:
    pass_commands(relay)
    for port in (0, 1):
        relay.to_board(QUERY + STOP, port)
        assert wait_for(relay.board, QUERY + STOP) == (BOARD_SIDE, relay.ports[port])
        for datagram in (CLEAR, bytes(range(256)) * 5):
            relay.to_pc(datagram, port)
            assert wait_for(relay.pc[port], datagram) == (PC_SIDE, relay.board_port)


def test_it_brakes_for_a_hit_by_itself(relay: RunningRelay) -> None:
    pass_commands(relay)
    drain(relay.board)
    relay.to_pc(HIT)
    wait_for(relay.board, wire.BRAKE)
    wait_for(relay.pc[0], HIT)


def test_strangers_do_not_count(relay: RunningRelay) -> None:
    with udp(STRANGER) as stranger, udp(relay.pc[0].getsockname()[0]) as other_port:
        for sock in (stranger, other_port):
            for _ in range(20):
                sock.sendto(STOP, (PC_SIDE, relay.board_port))
                sock.sendto(HIT, (BOARD_SIDE, relay.ports[0]))
        assert set(received(relay.board, 0.3)) == {wire.BRAKE}
        counters = relay.wait_for("start")["counters"]
    assert not counters.keys() & {"to_board", "to_pc", "hit", "garbage"}


def test_a_flood_of_both_sides_does_not_delay_the_lease(relay: RunningRelay) -> None:
    pass_commands(relay)
    relay.to_board(RUN)
    end_s = time.monotonic() + 1.0
    with udp(STRANGER) as stranger:
        while time.monotonic() < end_s:
            for _ in range(50):
                relay.to_pc(bytes(24))
                stranger.sendto(STOP, (PC_SIDE, relay.board_port))
                relay.to_board(bytes(2000))
    report = relay.wait_for("silent")
    assert report["counters"]["silent"] >= 1
    drain(relay.board)
    relay.to_board(RUN)
    assert set(received(relay.board, 0.3)) == {wire.BRAKE}
    pass_commands(relay)


def test_a_stalled_relay_does_not_pass_what_waited(relay: RunningRelay) -> None:
    pass_commands(relay)
    relay.to_board(RUN)
    wait_for(relay.board, RUN)
    relay.process.send_signal(signal.SIGSTOP)
    for datagram in (RUN, STOP, RUN):
        relay.to_board(datagram)
    time.sleep(0.5)
    drain(relay.board)
    relay.process.send_signal(signal.SIGCONT)
    assert set(received(relay.board, 0.3)) == {wire.BRAKE}


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_its_last_frame_is_brake(relay: RunningRelay, number: int) -> None:
    pass_commands(relay)
    relay.to_board(RUN)
    wait_for(relay.board, RUN)
    relay.process.send_signal(number)
    assert relay.process.wait(10) == 0
    assert received(relay.board, 0.1)[-1] == wire.BRAKE
    assert "passing" in relay.log.read_text()


def test_a_second_relay_ends_and_the_first_continues(relay: RunningRelay) -> None:
    assert relay.start().wait(20) == EXIT_LINK
    assert "another relay" in relay.log.read_text()
    pass_commands(relay)


def test_an_address_that_does_not_exist_yet_is_waited_for(relay: RunningRelay) -> None:
    other = relay.start("--pc-side", "192.0.2.1", "--board-side", "127.77.0.9")
    try:
        wait_until(lambda: "waiting for 192.0.2.1" in relay.log.read_text(), "the log line")
        source = "127.77.0.9", relay.ports[0]
        wait_until(lambda: (wire.BRAKE, source) in drain(relay.board), "BRAKE without a PC")
    finally:
        other.kill()
        other.wait()


@pytest.mark.parametrize(
    "words", [["--pc", "10.7.6"], ["--ports", "x"], ["--lease", "1"], ["--report-port", ""]]
)
def test_an_invalid_setting_ends_it(words: list[str]) -> None:
    assert main(words) == EXIT_CONFIG


def test_too_long_a_datagram_is_dropped(relay: RunningRelay) -> None:
    pass_commands(relay)
    relay.to_pc(bytes(2049))
    relay.to_pc(bytes(2048))
    wait_for(relay.pc[0], bytes(2048))
    wait_until(lambda: "too_long" in relay.wait_for("silent")["counters"], "the counter")
