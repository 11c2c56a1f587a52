"""What the board sends, and in which datagrams, by its firmware."""

import pytest

from common.wire import commands as c
from common.wire import reports as r
from sim.requests import Firmware
from tests.sim.sim_fixture import SimFixture, config


def sim_with(**firmware: object) -> SimFixture:
    return SimFixture(settings=config(sim={"firmware": firmware}))


def test_what_the_settings_say_holds_from_power_on() -> None:
    sim = sim_with(answers="second", echoes=False)
    assert sim.say(c.BumperBrakeSet(True)) == []
    sim.say(c.BumperQuery())
    assert sim.datagrams[-1].port == 4001


def test_a_request_changes_what_it_names_and_keeps_the_rest() -> None:
    sim = sim_with(answers="second", watchdog=0.5)
    sim.do(Firmware())
    assert sim.simulation.output.settings.answers == "asked"
    assert sim.simulation.output.settings.watchdog == 0.5


def test_a_split_frame_comes_in_two_datagrams() -> None:
    sim = sim_with(split=1.0)
    assert sim.say(c.UltrasonicQuery()) == []  # none of the two can be read
    first, second = sim.datagrams
    assert sim.framing.pack(r.UltrasonicReport((5000,) * 8)) == first.payload + second.payload


def test_some_frames_are_split() -> None:
    whole = len(sim_with(split=0.1).after(20.0))
    assert whole == pytest.approx(0.9 * 2000, abs=60)


def test_merged_frames_share_a_datagram_of_their_port() -> None:
    sim = sim_with(merge=0.05)
    assert sim.say(c.BumperQuery(), c.DistanceQuery()) == []
    said = sim.after(1.0)
    assert [datagram.port for datagram in sim.datagrams] == [4002, 4001] * 20
    assert len(said) == 102
    assert said[0] == r.BumperReport(False)
    assert len(sim.frames(sim.datagrams[0])) == 4  # both answers, and velocities at 50 Hz


def test_a_wait_shorter_than_a_step_is_one_step() -> None:
    assert len(sim_with(merge=0.001).after(1.0)) == 100


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
