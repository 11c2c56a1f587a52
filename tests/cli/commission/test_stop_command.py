"""``t2 checkout stop`` on recordings of synthetic stops."""

from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from cli.__main__ import main
from cli.commission.stops import Streams
from common.cli_args import EXIT_CONFIG
from common.freshness import NS_PER_S
from common.settings import Vehicle
from services.recorder.mcap_codec import Encoder
from services.recorder.writer import RecordingWriter
from t2 import codec
from t2.messages import Command, Message
from tests.cli.commission.stops_fixture import streams
from tests.recorder.samples import bare

PATHS = {"motions": "@cmd/motion", "velocities": "tel/bridge/velocity",
         "mileages": "tel/bridge/mileage"}  # fmt: skip
CAREFUL = (
    *("--set", "safety.react=0.4", "--set", "vehicle.deceleration=0.5"),
    *("--set", "vehicle.angular_deceleration=0.5"),
)


def record(path: Path, *robots: Streams) -> Path:
    """Record the streams of robot 001, and of 002."""
    messages: list[tuple[str, Message]] = [
        (f"t2/v1/00{number}/{key}", each)
        for number, streams in enumerate(robots, 1)
        for name, key in PATHS.items()
        for each in getattr(streams, name)
    ]
    writer = RecordingWriter(path, Encoder(Vehicle()))
    for key, each in sorted(messages, key=lambda one: one[1].mono_ns):
        at_s = each.mono_ns / NS_PER_S
        one = bare("", codec.encode(each), codec.encoding(type(each)), at_s)
        writer.write(replace(one, key=key))
    writer.write(bare("tel/mine", b"\xc1", at_s=at_s))
    writer.close()
    return path


def driven(*speeds: float, first_s: float = 10.0, turns: int = 2, **how: Any) -> Streams:
    """Return a stop from each speed (m/s, a negative one is backward), ten seconds apart.

    After them come turns of 0.5 rad/s to both sides.
    """
    made = Streams()
    for number, speed in enumerate((*speeds, 0.5, -0.5)[: len(speeds) + turns]):
        sign, begin_s = (1 if speed > 0 else -1), first_s + 10.0 * number
        turn = number >= len(speeds)
        one = streams(sign=sign, speed=abs(speed), begin_s=begin_s, turns=turn, **how)
        made.motions += one.motions
        made.velocities += one.velocities
        made.mileages += one.mileages
    return made


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("stops")
    return record(folder / "a.mcap", driven(0.3, -0.3, 0.7, 1.0, -1.0))


def test_stops_within_what_safety_reckons_with(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A stop in two recordings counts once: the black box records what `t2 record` also has."""
    assert main(["checkout", "stop", str(path), str(path), *CAREFUL]) == 0
    printed, errors = capsys.readouterr()
    assert printed.count("a.mcap") == 7
    assert "STOP backward" in printed
    assert "STOP right" in printed
    assert "Left out: 7 in two recordings.\n" in printed
    assert "The fastest stop is from 1.00 m/s; safety allows 1 m/s.\n" in printed
    assert "rad/s2 (vehicle.angular_deceleration is 0.5 rad/s2). The fastest" in printed
    assert printed.endswith("No stop was longer than safety reckons with.\n")
    assert not errors


def test_a_stop_that_was_too_long(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = record(tmp_path / "b.mcap", driven(0.6, -0.6, first_s=100.0, turns=0, deceleration=0.3))
    words = ["checkout", "stop", str(path), str(other)]
    assert main(words) == 1
    printed = capsys.readouterr().out
    assert "The worst is stop 8" in printed or "The worst is stop 9" in printed
    assert "NOT SAFE: this vehicle needs more" in printed
    rows = [line.split()[4:-1] for line in printed.splitlines() if line.endswith("b.mcap")]
    assert len(rows) == 2
    for speed, _, deceleration, distance, needed, reckoned in (map(float, row) for row in rows):
        assert deceleration == pytest.approx(0.3, rel=0.04)
        # two periods of the sonars and one of the decisions, from a reading to the command
        assert needed == pytest.approx(distance + 0.12 * speed, abs=0.002)
        assert reckoned == pytest.approx(0.27 * speed + speed**2 / 1.2, abs=0.002)
        assert needed > reckoned


def test_each_direction_is_needed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    forward = record(tmp_path / "c.mcap", driven(0.5))
    braked = driven(-0.5, first_s=50.0, turns=1, command=Command.BRAKE)
    backward = record(tmp_path / "d.mcap", braked)
    assert main(["checkout", "stop", str(forward), str(backward), *CAREFUL]) == 1
    printed = capsys.readouterr().out
    assert "BRAKE backward" in printed
    assert "NOT MEASURED: a STOP backward.\n" in printed
    assert "NOT MEASURED: a STOP left.\n" not in printed
    assert "NOT SAFE" not in printed


def test_robots_are_not_mixed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    merged = str(record(tmp_path / "two.mcap", driven(0.3, -0.3), driven(0.5, first_s=11.0)))
    assert main(["checkout", "stop", merged]) == 1
    assert "recordings of 001, 002: choose one with --robot" in capsys.readouterr().err
    assert main(["checkout", "stop", merged, "--robot", "001", *CAREFUL]) == 0
    assert capsys.readouterr().out.count("two.mcap") == 4


def test_what_it_cannot_evaluate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    slow = record(tmp_path / "slow.mcap", driven(0.05, turns=0))
    still = driven(0.5)
    still.motions = [motion for motion in still.motions if motion.command == "stop"]
    stands = record(tmp_path / "still.mcap", still)
    for words, code, error in (
        ((slow,), 1, "no stop to measure: a STOP or BRAKE from a steady speed, until standstill "),
        ((slow,), 1, "(1 slower than 0.1 m/s and 0.2 rad/s)"),
        ((stands,), 1, "(no RUN with speed ends)"),
        ((), EXIT_CONFIG, "name at least one recording: start `t2 record` on the robot"),
        ((slow, "--only", "link"), EXIT_CONFIG, "has no steps and no report"),
    ):
        assert main(["checkout", "stop", *map(str, words)]) == code
        assert error in capsys.readouterr().err
