"""What the board sends, and in which datagrams, by its firmware."""

import msgspec
import pytest

from common.wire import commands as c
from common.wire import framing
from common.wire import reports as r
from sim import requests as q
from t2.messages import Command
from tests.sim.sim_fixture import SimFixture, model


def sim_with(**firmware: object) -> SimFixture:
    return SimFixture(vehicle=model(firmware=firmware))


def test_a_request_replaces_the_model_s_firmware() -> None:
    sim = sim_with(confirms=False)
    assert sim.say(c.BumperBrakeSet(True)) == []
    sim.do(q.Firmware())
    assert sim.say(c.BumperBrakeSet(True)) == [r.BumperBrakeReport(True)]


def test_a_split_frame_comes_in_two_datagrams() -> None:
    sim = sim_with(split=1.0)
    assert sim.say(c.UltrasonicQuery()) == []  # none of the two can be read
    first, second = sim.datagrams
    assert framing.pack(r.UltrasonicReport((5000,) * 8)) == first.payload + second.payload


def test_merged_frames_share_a_datagram_of_their_port() -> None:
    sim = sim_with(merge=0.05)
    assert sim.say(c.BumperQuery(), c.DistanceQuery()) == []
    said = sim.after(1.0)
    assert [datagram.port for datagram in sim.datagrams] == [4002, 4001] * 20
    assert len(said) == 102
    assert said[0] == r.BumperReport(False)
    assert len(sim.frames(sim.datagrams[0])) == 4  # both answers, and velocities at 50 Hz


def test_a_watchdog_stops_a_vehicle_that_gets_no_commands() -> None:
    sim = sim_with(watchdog=0.5)
    for _ in range(10):
        sim.run(0.5)
        sim.after(0.4)
    assert sim.truth.linear == 0.5
    sim.after(0.2)
    assert 0 < sim.truth.linear < 0.5
    sim.after(1.0)
    assert sim.truth.linear == 0.0
    sim.run(0.5)
    sim.after(0.4)
    assert sim.truth.linear > 0.4


@pytest.mark.parametrize(
    ("firmware", "pressed", "ports"),
    [
        ({}, False, [4001]),
        ({"answers": "first"}, False, [4002]),
        ({"answers": "second"}, True, [4001]),
        ({"answers": "both"}, False, [4002, 4001]),
        ({"hits": "first"}, False, [4001]),
        ({"hits": "first"}, True, [4002]),
    ],
)
def test_answers_go_where_the_firmware_sends_them(
    firmware: dict[str, str], pressed: bool, ports: list[int]
) -> None:
    sim = SimFixture()
    sim.do(msgspec.convert({"do": "firmware", **firmware}, q.Firmware))
    sim.do(q.Bumper(pressed=pressed))
    sim.say(c.BumperQuery(), port=4001)
    assert [datagram.port for datagram in sim.datagrams] == ports


def test_a_board_that_ignores_stop_drives_on_and_obeys_break() -> None:
    sim = SimFixture()
    sim.run(0.3)
    sim.after(1.0)
    sim.do(q.Firmware(ignores=(Command.STOP,)))
    sim.stop()
    sim.after(1.0)
    assert sim.truth.linear == pytest.approx(0.3)
    assert sim.truth.command.kind == "stop"
    sim.say(c.MotionCommand(c.MotionKind.BREAK))
    sim.after(0.1)
    assert sim.truth.linear == 0.0


def test_every_third_report_of_a_kind_is_lost() -> None:
    sim = SimFixture()
    sim.do(q.Mute(reports=("bumper",), every=3))
    counts = [len(sim.say(c.BumperQuery())) for _ in range(9)]
    assert counts == [1, 1, 0] * 3
    assert [len(sim.say(c.DistanceQuery())) for _ in range(3)] == [1, 1, 1]
    sim.do(q.Mute())
    assert [len(sim.say(c.BumperQuery())) for _ in range(3)] == [1, 1, 1]
