"""Regularity of streams."""

import pytest

from cli.recordings.report.streams import Stream
from common.messages import Drive, EstopKeepalive, Velocity


def test_stream_rate_gaps_losses_and_restarts() -> None:
    stream = Stream("t2/v1/001/tel/bridge/velocity")
    for at_s, seq, boot in ((0.0, 1, 9), (0.02, 2, 9), (0.5, 5, 9), (0.52, 1, 10)):
        stream.add(at_s, Velocity(seq=seq, boot=boot, linear=0.0, angular=0.0))
    stream.add(0.54, None)
    assert (stream.expected_hz, stream.lost, stream.restarts, stream.undecoded) == (50, 2, 1, 1)
    assert stream.hz == pytest.approx(4 / 0.54)
    assert stream.gaps == [(0.02, 0.5)]
    assert stream.interval_s(1.0) == pytest.approx(0.48)


def test_two_publishers_at_the_same_time_are_no_restarts() -> None:
    stream = Stream("t2/v1/001/tel/recorder/health")
    for number in range(10):  # two recorders of one robot
        for boot in (5, 6):
            stream.add(number + boot / 10, Velocity(seq=number, boot=boot, linear=0, angular=0))
    assert (stream.restarts, stream.concurrent, stream.lost) == (0, 1, 0)
    stream.add(11.0, Velocity(seq=1, boot=7, linear=0, angular=0))
    assert (stream.restarts, stream.concurrent) == (1, 1)


def test_an_unknown_key_is_only_counted() -> None:
    stream = Stream("t2/v1/001/tel/lidar/points")
    stream.add(0.0, None)
    assert (stream.hz, stream.gaps, stream.interval_s(0.5)) == (None, [], None)
    stream.add(9.0, None)
    assert stream.gaps == []
    assert stream.hz == pytest.approx(1 / 9)


def test_a_source_that_requested_nothing_lost_nothing() -> None:
    stream = Stream("t2/v1/001/@cmd/drive/teleop")
    for at_s, seq in ((0.0, 1), (0.05, 2), (9.0, 3), (9.05, 4), (10.0, 9)):
        stream.add(at_s, Drive(seq=seq, boot=9, linear=0.0, angular=0.0, echo=1))
    assert stream.silences == [(0.05, 9.0)]
    assert (stream.gaps, stream.lost) == ([(9.05, 10.0)], 4)
    assert stream.hz == pytest.approx(3 / 1.05)
    assert stream.interval_s(1.0) == pytest.approx(0.95)


def test_a_source_that_falls_silent_while_it_drives_has_a_gap() -> None:
    stream = Stream("t2/v1/001/@cmd/drive/teleop")
    for at_s, seq in ((0.0, 1), (0.05, 2), (0.85, 3)):
        stream.add(at_s, Drive(seq=seq, boot=9, linear=0.5, angular=0.0, echo=1))
    assert (stream.silences, stream.gaps) == ([], [(0.05, 0.85)])


def test_a_keepalive_that_falls_silent_has_a_gap() -> None:
    stream = Stream("t2/v1/001/@cmd/estop_keepalive/web")
    for at_s, seq in ((0.0, 1), (2.9, 2)):
        stream.add(at_s, EstopKeepalive(seq=seq, boot=9, echo=1))
    assert (stream.silences, stream.gaps) == ([], [(0.0, 2.9)])


def test_an_emergency_stop_has_no_message_to_decode() -> None:
    stream = Stream("t2/v1/001/estop")
    stream.add(0.0, None)
    assert (stream.undecoded, len(stream.times)) == (0, 1)
