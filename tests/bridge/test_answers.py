"""Answers that come to one port only or get lost, with a real bridge."""

import random
import time

import pytest

from common.wire import reports
from common.wire.commands import MotionKind
from common.wire.frame import HEADER
from common.wire.framing import crc_function
from tests.bridge.bridge_fixture import BridgeFixture
from verification.harness.waiting import wait_until


def test_a_hit_on_the_other_port_is_braked_for_while_it_drives(bridge: BridgeFixture) -> None:
    bridge.board.answers_to, bridge.board.hits_to = [0], [1]
    bridge.drive()
    bridge.board.pressed = True
    bridge.board.wait_for(MotionKind.BREAK)
    wait_until(lambda: "contact" in bridge.events(), "the event")
    wait_until(lambda: bridge.newest("tel/bridge/bumper").pressed, "the bumper message")


@pytest.mark.parametrize("answers", [0, 1])
def test_answers_on_one_port_only_arm_and_drive(bridge: BridgeFixture, answers: int) -> None:
    bridge.board.to_ports, bridge.board.answers_to = [1 - answers], [answers]
    bridge.drive()
    ports = bridge.board.ports
    wait_until(
        lambda: (
            (link := bridge.link())
            and link.ports.get("VelocityReport") == ports[1 - answers]
            and link.ports.get("BumperReport") == ports[answers]
        ),
        "the ports in the link",
    )


def test_what_is_not_answered_is_told_with_what_is_waited_for(bridge: BridgeFixture) -> None:
    bridge.board.answers_to = []
    wait_until(
        lambda: (link := bridge.link()) and "no answers to: bumper, mileage" in link.waiting,
        "the link names the missing answers",
    )
    bridge.board.answers_to = [1]
    bridge.drive()


@pytest.mark.timed
def test_short_presses_are_seen_although_every_third_answer_is_lost(bridge: BridgeFixture) -> None:
    """Presses of 60 ms at any time; 6 of 18 were missed when each query waited for its answer."""
    bridge.drive()
    bridge.board.lose_every = 3
    time.sleep(0.5)
    asked, began_s = bridge.board.bumper_asks, time.monotonic()
    time.sleep(2.0)
    rate_hz = (bridge.board.bumper_asks - asked) / (time.monotonic() - began_s)
    assert 45 < rate_hz < 52
    samples = bridge.seen["tel/bridge/bumper"][-40:]
    assert {3, 4} & {sample.lost for sample in samples}
    for _ in range(18):
        hits = bridge.events().count("contact")
        time.sleep(random.random() * 0.02)
        bridge.board.pressed = True
        time.sleep(0.06)
        bridge.board.pressed = False
        wait_until(lambda: bridge.events().count("contact") > hits, "the hit", 1.0)  # noqa: B023
        wait_until(lambda: not bridge.newest("tel/bridge/bumper").pressed, "clear again")
    bridge.board.lose_every = 0
    wait_until(lambda: bridge.newest("tel/bridge/bumper").lost == 0, "none lost")


def test_any_nonzero_byte_of_the_bumper_is_a_hit(bridge: BridgeFixture) -> None:
    bridge.drive()
    bridge.board.say_bytes(hit_of(0x80))
    bridge.board.wait_for(MotionKind.BREAK)


def hit_of(byte: int) -> bytes:
    """Return a frame of the bumper with this byte."""
    payload = bytes((byte,))
    return HEADER.pack(reports.BumperReport.OPENING, crc_function("crc-16")(payload)) + payload
