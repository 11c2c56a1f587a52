"""The fast scenarios against this tree, and the frames by the numbers that are known for them."""

from pathlib import Path

import pytest

from verification.outside import wire
from verification.outside.scenarios import SCENARIOS
from verification.outside.testbed import Scenario, measure

TREE = Path(__file__).resolve().parents[3]
CORE = ("hit_on_first", "faulty_front")  # short, and with margin on a busy host


def test_the_crc_is_crc_16_arc() -> None:
    assert wire.crc16(b"123456789") == 0xBB3D


def test_a_frame_is_packed_and_little_endian() -> None:
    assert wire.frame(wire.BUMPER, b"\x01") == bytes.fromhex("4753 0900 0276 c1c0 01")
    assert wire.frame(wire.DISTANCE, b"") == bytes.fromhex("4753 0800 0076 0000")


def test_a_datagram_holds_several_frames_and_ends_at_a_damaged_one() -> None:
    good = wire.frame(wire.BUMPER, b"\x00")
    bad = wire.frame(wire.BUMPER, b"\x01")[:-1] + b"\x02"
    assert wire.frames(good + good + bad + good) == [(wire.BUMPER, b"\x00")] * 2


@pytest.mark.parametrize(("value", "coded"), [(500, 500), (-500, 0x81F4), (0, 0), (-0.2, 0)])
def test_speeds_are_sign_and_magnitude(value: float, coded: int) -> None:
    assert wire.magnitude(value) == coded
    assert wire.signed(coded) == round(value)


@pytest.mark.parametrize(
    ("turned", "heading"), [(0.0, 0), (3.14159, 1800 - 3600), (-0.01745329, -10), (6.3, 10)]
)
def test_the_heading_wraps_at_half_a_turn(turned: float, heading: int) -> None:
    assert int.from_bytes(wire.distance(0.0, turned)[12:], "little", signed=True) == heading


@pytest.mark.timed
@pytest.mark.campaign
@pytest.mark.parametrize(
    "scenario",
    [each for each in SCENARIOS if each.run.__name__ in CORE],
    ids=lambda each: each.run.__name__,
)
def test_a_short_scenario_is_as_expected(scenario: Scenario) -> None:
    result = measure(TREE, scenario)
    assert result.ok, f"expected: {scenario.expected}; measured: {result.measured}"
