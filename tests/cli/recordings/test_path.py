"""Paths in the map: segments, ellipses, states, and which fixes were used."""

from typing import Any

import pytest

from cli.recordings.path import MapFix, MapTrack
from t2.messages import Fix, FixState
from tests import factories

KEY = "t2/v1/001/@cmd/fix/tags"


def fix(x: float) -> Fix:
    return Fix(x=x, y=0.0, covariance=(0.01,) * 9, odom_boot=1, odom_seq=1)


def counted(used: int, refused: int, in_a_row: int) -> FixState:
    return factories.fix_state(used=used, refused=refused, in_a_row=in_a_row)


def track_of(*steps: tuple[float, Any]) -> MapTrack:
    """Return the track of fixes (by x) and of poses with these counters, at times in s."""
    track = MapTrack()
    for at_s, step in steps:
        is_fix = isinstance(step, float)
        message = fix(step) if is_fix else factories.map_pose(sources=(counted(*step),))
        track.add(message, KEY, at_s)
    return track


@pytest.mark.parametrize(
    ("steps", "expected"),
    [
        ([(0.0, (7, 7, 0)), (0.1, 1.0), (0.2, (8, 7, 0))], [(1.0, True)]),
        ([(0.0, (7, 7, 0)), (0.1, 1.0), (0.2, (7, 8, 1))], [(1.0, False)]),
        (  # several between two poses: the refused ones since the last used one are known
            [(0.0, (7, 7, 0)), (0.1, 1.0), (0.1, 2.0), (0.1, 3.0), (0.2, (8, 9, 1))],
            [(1.0, False), (2.0, True), (3.0, False)],
        ),
        (  # the recorder may get a fix before a pose that does not count it yet
            [(0.0, (7, 7, 0)), (0.1, 1.0), (0.11, (7, 7, 0)), (0.2, (8, 7, 0))],
            [(1.0, True)],
        ),
        (  # one that localization has not counted in time is not the next one
            [(0.0, (0, 0, 0)), (0.1, 1.0), (5.0, 2.0), (5.1, (0, 1, 1))],
            [(2.0, False)],
        ),
        (  # fixes that the recorder lost are counted first
            [(0.0, (0, 0, 0)), (0.1, 1.0), (0.2, (1, 2, 0))],
            [(1.0, True)],
        ),
        ([(0.1, 1.0), (0.2, (8, 7, 0))], []),  # counted before the recording, or not
    ],
)  # fmt: skip
def test_whether_a_fix_was_used(
    steps: list[tuple[float, Any]], expected: list[tuple[float, bool]]
) -> None:
    assert track_of(*steps).fixes == [MapFix(x, 0.0, used) for x, used in expected]


def test_a_restarted_service_counts_from_its_own_first_pose() -> None:
    track = MapTrack()
    for at_s, boot, used in ((0.0, 1, 9), (1.0, 2, 0), (2.0, 2, 1)):
        track.add(fix(at_s), KEY, at_s)
        pose = factories.map_pose(boot=boot, sources=(counted(used, 0, 0),))
        track.add(pose, "", at_s + 0.1)
    assert [each.used for each in track.fixes] == [True]


def test_the_path_begins_anew_with_a_placement_and_has_an_ellipse_every_five_seconds() -> None:
    track = MapTrack()
    for at_s in range(12):
        track.add(factories.map_pose(x=float(at_s), placement=1 + at_s // 6), "", float(at_s))
    assert [segment.xs for segment in track.path] == [
        [0.0, 1.0, 2.0, 3.0, 4.0, 5.0], [6.0, 7.0, 8.0, 9.0, 10.0, 11.0],
    ]  # fmt: skip
    assert [each.x for each in track.ellipses] == [0.0, 5.0, 10.0]
    assert track.ellipses[0].axes == pytest.approx((0.2, 0.1, 0.0))


def test_the_states_without_gaps_of_the_service() -> None:
    track = MapTrack()
    for at_s, state in ((0.0, "unplaced"), (0.4, "unplaced"), (0.8, "placed"), (3.0, "placed"),
                        (3.2, "lost")):  # fmt: skip
        track.add(factories.map_pose(state), "", at_s)
    spans = [(each.state, each.begins_s, each.ends_s) for each in track.states]
    assert spans == [
        ("unplaced", 0.0, 0.8), ("placed", 0.8, 0.8), ("placed", 3.0, 3.2), ("lost", 3.2, 3.2),
    ]  # fmt: skip
    assert track.lasted_s("placed") == pytest.approx(0.2)
    assert len(track.path[0].xs) == 3  # a lost pose is still the best one
