"""Regularity of streams."""

import pytest

from cli.recordings.streams import Stream
from common.messages import Drive, Velocity


def test_rate_gaps_losses_and_publishers() -> None:
    stream = Stream("t2/v1/001/tel/bridge/velocity")
    for at_s, seq, boot in ((0.0, 1, 9), (0.02, 2, 9), (0.5, 5, 9), (0.52, 1, 10)):
        stream.add(at_s, Velocity(seq=seq, boot=boot, linear=0.0, angular=0.0))
    stream.add(0.54, None)
    assert (stream.expected_hz, stream.lost, stream.publishers, stream.undecoded) == (50, 2, 2, 1)
    assert stream.hz == pytest.approx(4 / 0.54)
    assert stream.gaps == [(0.02, 0.5)]
    assert stream.longest == (0.02, 0.5)


def test_two_publishers_at_the_same_time_lose_nothing() -> None:
    stream = Stream("t2/v1/001/tel/recorder/health")
    for number in range(10):  # two recorders of one robot
        for boot in (5, 6):
            stream.add(number + boot / 10, Velocity(seq=number, boot=boot, linear=0, angular=0))
    assert (stream.publishers, stream.lost) == (2, 0)


def test_a_gap_is_longer_than_three_periods() -> None:
    stream = Stream("t2/v1/001/tel/recorder/health")  # 1 Hz
    for at_s in (0.0, 3.0, 6.5):
        stream.add(at_s, None)
    assert stream.gaps == [(3.0, 6.5)]


@pytest.mark.parametrize("path", ["tel/lidar/points", "@cmd/drive/teleop", "evt/safety"])
def test_a_key_without_a_rate_has_no_gaps(path: str) -> None:
    stream = Stream(f"t2/v1/001/{path}")
    stream.add(0.0, Drive(seq=1, boot=9, linear=0.0, angular=0.0, echo=1))
    assert (stream.hz, stream.gaps, stream.longest) == (None, [], (0.0, 0.0))
    stream.add(9.0, Drive(seq=2, boot=9, linear=0.0, angular=0.0, echo=1))
    assert (stream.gaps, stream.expected_hz, stream.longest) == ([], 0.0, (0.0, 9.0))
    assert stream.hz == pytest.approx(1 / 9)


def test_an_emergency_stop_has_no_message_to_decode() -> None:
    stream = Stream("t2/v1/001/estop")
    stream.add(0.0, None)
    assert (stream.undecoded, len(stream.times)) == (0, 1)
