"""Error and NEES of odometry in synthetic closed drives."""

import math
from collections.abc import Callable

import pytest
from msgspec.structs import replace

from cli.fit.closed import (
    Closed,
    ClosedDrive,
    check_distinct,
    closed_drive,
    lower_quantile,
    nees,
)
from cli.fit.streams import Streams
from common.freshness import NS_PER_S
from common.pose import Pose
from services.odom.config import Odom
from tests.cli.fit.closed_fixture import TRUE, closed_streams

TINY = Odom(distance_noise=1e-6, turn_noise=1e-6, drift_noise=1e-6)
SMALL = Pose(0.1, 0.1, 0.01)


def drives(*numbers: float, error: Pose = SMALL) -> list[ClosedDrive]:
    """Return drives with these NEES, one after the other."""
    return [
        ClosedDrive(
            name=f"{number}.mcap", host=1, begin_ns=number * 10, end_ns=number * 10 + 5, way=20.0,
            error=error, nees=value,
        )
        for number, value in enumerate(numbers)
    ]  # fmt: skip


def test_the_factor_of_the_true_noises_is_found() -> None:
    """Odometry of today's noises on counters whose noises are twice as large, and the same."""
    twice = Odom(distance_noise=0.02, turn_noise=0.04, drift_noise=0.02)
    for noise, truth in ((TRUE, 1.0), (twice, 2.0)):
        made = [closed_drive("a", closed_streams(seed, noise=noise), TRUE) for seed in range(25)]
        found = Closed(made, TRUE)
        assert found.factor == pytest.approx(truth, rel=0.15)
        assert truth < found.bound < 1.4 * truth


def test_a_drive_without_noise_ends_at_its_beginning() -> None:
    found = closed_drive("a.mcap", closed_streams(1, noise=TINY), TRUE)
    assert found.way == pytest.approx(20.0, abs=0.01)
    assert math.hypot(found.error.x, found.error.y) < 0.01
    assert found.nees < 0.01
    assert not Closed([found], TRUE).proposals  # one drive makes no noise smaller


def test_the_error_is_in_the_frame_of_the_first_pose() -> None:
    """Odometry ran before, and the pose was anywhere: the same drive has the same error."""
    here = closed_streams(3)
    there = closed_streams(3)
    cos, sin = math.cos(2.0), math.sin(2.0)
    there.odometries = [
        replace(
            each, x=7 + cos * each.x - sin * each.y, y=-3 + sin * each.x + cos * each.y,
            heading=math.remainder(each.heading + 2.0, math.tau),
        )
        for each in there.odometries
    ]  # fmt: skip
    first, second = (closed_drive("a", each, TRUE) for each in (here, there))
    assert first.nees == pytest.approx(second.nees)
    assert (first.error.x, first.error.y) == pytest.approx((second.error.x, second.error.y))


def test_nees_is_the_squared_distance_in_standard_deviations() -> None:
    assert nees(((4, 0, 0), (0, 9, 0), (0, 0, 1)), (2, 3, 2)) == pytest.approx(6)
    # correlated: checked by hand, 1 / det = 1 / 3 and the adjugate ((2, -1), (-1, 2))
    assert nees(((2, 1, 0), (1, 2, 0), (0, 0, 1)), (1, -1, 0)) == pytest.approx(2)


def test_the_quantile_is_that_of_the_tables() -> None:
    """NIST/SEMATECH e-Handbook of Statistical Methods, 1.3.6.7.4; never above it."""
    rows = ((3, 0.352, 0.08), (6, 1.635, 0.02), (15, 7.261, 2e-3), (30, 18.493, 1e-3))
    for freedom, value, below in rows:
        assert value * (1 - below) < lower_quantile(freedom) < value * 1.0002


def test_the_noises_grow_by_the_bound_and_shrink_only_by_five_drives() -> None:
    grown = Closed(drives(12.0, 12.0), TRUE)
    assert grown.factor == pytest.approx(2.0)
    assert grown.bound == pytest.approx(math.sqrt(24 / 1.62), rel=0.01)  # 3.85
    assert grown.proposals == {
        "odom.distance_noise": 0.039, "odom.turn_noise": 0.077, "odom.drift_noise": 0.039
    }  # fmt: skip
    assert "3 more closed drives are missing until a noise may be smaller." in list(grown.lines())
    few, enough = Closed(drives(*[0.3] * 4), TRUE), Closed(drives(*[0.3] * 5), TRUE)
    assert few.bound < 1
    assert few.proposals == {}
    assert "No noise is proposed: today's are kept." in list(few.lines())
    assert enough.proposals["odom.distance_noise"] == 0.005
    assert not any("missing" in line for line in enough.lines())


@pytest.mark.parametrize("error", [Pose(0.8, 0.7, 0.0), Pose(0.0, 0.0, -0.6)])
def test_a_gross_error_is_named_and_proposes_nothing(error: Pose) -> None:
    found = Closed([*drives(3.0, 3.0), *drives(99.0, error=error)], TRUE)
    (named,) = (line for line in found.lines() if "did it really end at the mark?" in line)
    assert "0.mcap" in named
    assert found.proposals == {}


def gap(made: Streams) -> None:
    made.mileages = made.mileages[:200] + made.mileages[210:]


def moving(made: Streams) -> None:
    made.velocities = made.velocities[:-60]
    made.mileages = made.mileages[:-60]


def set_pose(made: Streams) -> None:
    at_ns = 30 * NS_PER_S
    made.odometries = [replace(each, epoch=each.mono_ns >= at_ns) for each in made.odometries]


def restart(stream: str, field: str) -> Callable[[Streams], None]:
    def change(made: Streams) -> None:
        messages = getattr(made, stream)
        half = len(messages) // 2
        after = [replace(each, **{field: getattr(each, field) + 1}) for each in messages[half:]]
        setattr(made, stream, messages[:half] + after)

    return change


def elsewhere(made: Streams) -> None:
    made.odometries[-1] = replace(made.odometries[-1], x=made.odometries[-1].x + 0.3)


def stand(made: Streams) -> None:
    made.mileages = [replace(each, distance=0.0) for each in made.mileages]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda made: made.odometries.clear(), "has no tel/odom/odometry"),
        (set_pose, "odometry's pose was set after 20 s"),
        (restart("odometries", "boot"), "odometry restarted after 2. s"),
        (restart("mileages", "boot"), "the bridge restarted after 2. s"),
        (restart("mileages", "epoch"), "the board restarted after 2. s"),
        (gap, "counters are missing for 1.10 s"),
        (moving, "the vehicle moves at its end"),
        (elsewhere, "odometry's pose is 0.30 m and 0.0 degrees from that of the recorded counters"),
        (stand, "it drives 0.0 m only: drive 5 m or more"),
    ],
)
def test_what_shows_no_error_is_refused(change: Callable[[Streams], None], reason: str) -> None:
    made = closed_streams(1)
    change(made)
    with pytest.raises(ValueError, match=reason):
        closed_drive("a.mcap", made, TRUE)


def test_a_drive_counts_once() -> None:
    one, other = drives(1.0, 1.0)
    check_distinct([one, other])
    with pytest.raises(ValueError, match=r"0.mcap and 1.mcap are of the same time: name one"):
        check_distinct([one, replace(other, begin_ns=4)])
    check_distinct([one, replace(other, begin_ns=4, host=2)])
