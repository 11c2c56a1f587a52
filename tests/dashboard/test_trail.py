"""The way, thinned and bounded."""

from services.dashboard.trail import POINTS, SPACING_M, Trail


def test_near_points_are_left_out() -> None:
    trail = Trail()
    for x in (0.0, SPACING_M / 2, SPACING_M, SPACING_M * 1.5):
        assert not trail.add(x, 0.0, epoch=0)
    assert list(trail.points) == [(0.0, 0.0), (SPACING_M, 0.0)]


def test_a_new_epoch_begins_anew() -> None:
    trail = Trail()
    trail.add(0.0, 0.0, epoch=0)
    assert trail.add(5.0, 5.0, epoch=1)
    assert list(trail.points) == [(5.0, 5.0)]


def test_the_oldest_go() -> None:
    trail = Trail()
    for x in range(POINTS + 1):
        trail.add(float(x), 0.0, epoch=0)
    assert len(trail.points) == POINTS
    assert trail.points[0] == (1.0, 0.0)


def test_what_odometry_remembers_comes_before() -> None:
    trail = Trail()
    trail.add(2.0, 0.0, epoch=4)
    trail.begin([(0.0, 0.0), (1.0, 0.0)], epoch=4)
    assert list(trail.points) == [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)]
    trail.begin([(9.0, 9.0)], epoch=3)
    assert len(trail.points) == 3


def test_a_memory_may_be_all_there_is() -> None:
    trail = Trail()
    trail.begin([(1.0, 0.0)], epoch=2)
    assert trail.add(3.0, 0.0, epoch=3)
    assert list(trail.points) == [(3.0, 0.0)]
