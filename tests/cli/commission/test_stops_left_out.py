"""Stops that are left out with the reason, slopes, and problems of a recording."""

from collections.abc import Callable, Sequence

import pytest
from msgspec.structs import replace

from cli.commission.stops import Streams, UnsuitableError, find_stops, slope
from common.freshness import NS_PER_S
from common.messages import Bumper, Health, Motion
from common.motion import Command
from tests.cli.commission.stops_fixture import (
    at,
    changed,
    left,
    streams,
)


def test_missing_velocities() -> None:
    none = changed(streams(), lambda v, now: v if now > 0 else None)
    assert left(none) == "velocities are missing"
    one = changed(streams(), lambda v, now: v if now > -0.02 else None)
    assert len(find_stops(one)[0]) == 1
    old = changed(streams(), lambda v, now: v if now > 0 or now < -0.1 else None)
    assert left(old) == "velocities are missing"
    gap = changed(streams(), lambda v, now: v if not 0.5 < now < 0.6 else None)
    assert left(gap) == "velocities are missing"
    short = changed(streams(), lambda v, now: v if not 0.5 < now < 0.58 else None)
    assert len(find_stops(short)[0]) == 1
    assert left(streams(until_s=1.5)) == "the recording ends before standstill"
    one = changed(streams(), lambda v, now: v if now < 0.0 else None)
    assert left(one) == "the recording ends before standstill"


def test_a_single_velocity_of_zero_is_no_standstill() -> None:
    glitch = changed(streams(), lambda v, now: replace(v, linear=0.0) if 0.5 < now < 0.52 else v)
    (stop,), _ = find_stops(glitch)
    assert stop.distance > 0.7


def test_a_vehicle_that_still_turns_does_not_stand() -> None:
    turns = changed(streams(), lambda v, now: replace(v, angular=0.2) if now > 1.0 else v)
    assert left(turns) == "the recording ends before standstill"


def test_a_pressed_bumper() -> None:
    assert left(streams(at(Bumper(pressed=True), 0.0))) == "the bumper was pressed"
    assert left(streams(at(Bumper(pressed=True), 1.685))) == "the bumper was pressed"
    for bumper, now in ((False, 0.5), (True, -0.01), (True, 1.69)):
        found, _ = find_stops(streams(at(Bumper(pressed=bumper), now)))
        assert len(found) == 1


def counted(keep: Callable[[float], bool]) -> Streams:
    made = streams()
    made.mileages = [m for m in made.mileages if keep(m.mono_ns / NS_PER_S - 10)]
    return made


def test_missing_counters() -> None:
    for keep in (
        lambda now: now > 0,
        lambda now: now < 1.69,
        lambda now: now < 0,
        lambda now: not -0.1 < now < 0.15,
        lambda now: not 1.7 < now < 1.9,
    ):
        assert left(counted(keep)) == "counters are missing"
    for keep in (lambda now: not -0.1 < now < 0.05, lambda now: not 1.7 < now < 1.88):
        assert len(find_stops(counted(keep))[0]) == 1


@pytest.mark.parametrize("change", [{"epoch": 1}, {"boot": 4}])
def test_a_restart_during_the_stop(change: dict[str, int]) -> None:
    made = streams()
    half = len(made.mileages) // 2
    made.mileages[half:] = [replace(m, **change) for m in made.mileages[half:]]
    assert left(made) == "bridge or board restarted"
    made.mileages = made.mileages[:3] + [replace(m, **change) for m in made.mileages[3:]]
    assert len(find_stops(made)[0]) == 1


def test_what_begins_a_stop() -> None:
    """Only the first STOP or BRAKE after a RUN with speed."""
    made = streams()
    made.motions = [
        Motion(command=Command.STOP),
        Motion(command=Command.RUN, linear=0.0004),
        Motion(command=Command.STOP),
        Motion(command=Command.STOP),
        Motion(command=Command.RUN, linear=0.5),
        Motion(command=Command.RUN, linear=0.5),
    ]
    assert find_stops(made) == ([], {})


def test_a_rate_that_is_not_falling() -> None:
    with pytest.raises(UnsuitableError, match=r"^the speed does not fall steadily$"):
        slope([(0.0, 1.0), (0.1, 0.2), (0.2, 0.5), (0.3, 0.8), (0.4, 0.0)])
    with pytest.raises(UnsuitableError, match=r"^the speed does not fall steadily$"):
        slope([(0.0, 1.0), (0.1, 0.5), (0.2, 0.5), (0.3, 0.5), (0.4, 0.0)])


@pytest.mark.parametrize(
    ("speeds", "reaction", "deceleration"),
    [
        ((1.0, 0.8, 0.4, 0.2, 0.0), 0.0222222, 3.0),  # a line through three velocities
        ((2.0, 1.6, 1.0, 0.4, 0.1, 0.0), 0.0333333, 6.0),
        ((0.15, 0.1, 0.05, 0.02, 0.019), -0.0333333, 0.4),  # 0.019 m/s is standstill
        ((1.0, 1.0, 0.6, 0.3, 0.0), 0.1, 1 / 0.3),  # two: between 1.0 and 0.0
        ((1.0, 0.95, 0.9, 0.5, 0.1, 0.05), 0.175, 4.0),  # 0.9 and 0.1 belong to the slope
        ((1.0, 0.5, 1.0, 0.8, 0.5, 0.2, 0.0), 0.2333333, 3.0),  # from the last full speed
    ],
)
def test_the_slope(speeds: Sequence[float], reaction: float, deceleration: float) -> None:
    points = [(number / 10, speed) for number, speed in enumerate(speeds)]
    assert slope(points) == pytest.approx((reaction, deceleration), rel=1e-5)


def test_problems_of_a_recording() -> None:
    assert not streams().problem
    made = Streams()
    assert made.period_s == 0.0
    made.add(Health(service="x", version="", uptime=0, rates={}, counters={}, lateness=0, rss=0))
    assert made.problem == (
        "has no @cmd/motion and no tel/bridge/velocity and no tel/bridge/mileage: "
        "record all keys with `t2 record`"
    )
    one = streams()
    one.velocities.clear()
    assert one.problem.startswith("has no tel/bridge/velocity:")
    coarse = streams()
    coarse.velocities = coarse.velocities[::5]
    assert coarse.problem.startswith("has a velocity each 0.10 s, too coarse for a stop")
