"""A trace that is followed while it grows, and the reactions that it shows."""

from pathlib import Path

import pytest

from common import motion
from sim.trace import Command
from verification.harness.trace import Tail, first_stop_s, last_move_s

RUN, STOP, BRAKE = motion.Command


def command(
    ms: float, kind: motion.Command = RUN, linear: float = 0.8, angular: float = 0.0
) -> Command:
    return Command(mono_ns=round(ms * 1e6), kind=kind, linear=linear, angular=angular)


def test_the_first_stop_and_the_last_move_after_a_fault() -> None:
    made = [
        command(0, STOP, 0), command(90), command(100), command(110), command(120, BRAKE, 0),
        command(130), command(140, STOP, 0), command(150, linear=0.0),
    ]  # fmt: skip
    assert first_stop_s(made, round(100e6)) == pytest.approx(0.020)
    assert last_move_s(made, round(100e6)) == pytest.approx(0.030)
    assert first_stop_s(made[:4], round(100e6)) is None
    assert last_move_s(made, round(131e6)) == 0.0


def test_a_growing_file_is_read_by_whole_lines(tmp_path: Path) -> None:
    tail = Tail(tmp_path / "log")
    assert tail.read() == b""
    with (tmp_path / "log").open("ab", buffering=0) as file:
        file.write(b"one\ntw")
        assert tail.read() == b"one\n"
        assert tail.read() == b""
        file.write(b"o\nthree\n")
        assert tail.read() == b"two\nthree\n"
    assert tail.bytes == 14


def test_a_file_that_was_begun_anew_is_read_from_its_start(tmp_path: Path) -> None:
    file, tail = tmp_path / "trace", Tail(tmp_path / "trace")
    file.write_bytes(b"a long line\n")
    assert tail.read() == b"a long line\n"
    file.write_bytes(b"new\n")
    assert tail.read() == b"new\n"
