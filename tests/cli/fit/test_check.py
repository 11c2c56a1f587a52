"""The fitted vehicle under recorded commands."""

import pytest
from msgspec.structs import replace

from cli.fit.check import compare, counted, follow, lines
from cli.fit.streams import Streams
from sim.model import Drive, Model
from t2.messages import Command, Motion
from tests.cli.fit.test_steady import drive

PROMPT = Model(drive=Drive(acceleration=100.0, coast=100.0))
PARTS = ((1.0, 0.0, 0.0), (2.0, 0.4, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.5), (1.0, 0.0, 0.0))


def test_a_model_that_moves_as_recorded_explains_it() -> None:
    _, differences = compare(drive(*PARTS), [], PROMPT)
    assert [each.name for each in differences] == [
        "distance", "turn", "speed while moving, m/s", "speed while moving, rad/s",
    ]  # fmt: skip
    assert all(each.is_explained for each in differences)
    assert list(lines(differences))[-1] == "The model explains the recording."


@pytest.mark.parametrize(
    ("model", "wrong"),
    [
        (Model(drive=Drive(acceleration=0.2)), "distance"),
        (Model(drive=Drive(angular_acceleration=0.2)), "turn"),
        (Model(drive=Drive(acceleration=100.0, coast=100.0, dead_time=0.5)), "speed while moving"),
    ],
)
def test_a_model_that_moves_otherwise_says_so(model: Model, wrong: str) -> None:
    _, differences = compare(drive(*PARTS), [], model)
    found = list(lines(differences))
    assert any(line.startswith(wrong) and "NOT EXPLAINED" in line for line in found)
    assert found[-1].startswith("The model does NOT explain the recording")


def test_a_command_ends_with_the_lease_of_the_bridge() -> None:
    run = Motion(command=Command.RUN, linear=0.5, mono_ns=0)
    course = follow([run, replace(run, mono_ns=10**9)], PROMPT)
    speeds = [twist.linear for twist in course.twists]
    assert speeds[:20] == [0.5] * 20
    assert speeds[20:] == [0.0] * 80


def test_counters_of_two_starts_are_no_motion() -> None:
    made = drive(*PARTS)
    way, turn = counted(made)
    assert (way, turn) == pytest.approx((0.8, 1.0), rel=0.05)
    made.mileages = [
        replace(m, distance=m.distance + 100 * (n > 80), epoch=int(n > 80))
        for n, m in enumerate(made.mileages)
    ]
    assert counted(made)[0] == pytest.approx(0.8, rel=0.05)
    assert counted(Streams()) == (0, 0)
