"""When a picture was taken: heartbeats, lateness, frozen pictures."""

import pytest

from common.freshness import NS_PER_S
from common.heartbeat import Heartbeat
from services.camera.core import DRIFT_PPM, Lateness, Watch, heartbeat_before, moved
from t2.messages import Velocity

MS = NS_PER_S // 1000


@pytest.mark.parametrize(
    ("linear", "angular", "expected"),
    [
        (0.0, 0.0, 0.0), (0.05, -0.1, 0.0), (-0.06, 0.0, 6.0), (0.0, -0.11, 11.0), (0.4, 0.2, 40.0),
        (0.06, 0.2, 20.0), (0.1, 0.06, 10.0),
    ],
)  # fmt: skip
def test_motion_above_the_noise(linear: float, angular: float, expected: float) -> None:
    assert moved(Velocity(linear=linear, angular=angular), 2.0) == pytest.approx(expected)


def test_a_picture_carries_the_newest_heartbeat_of_its_time() -> None:
    heartbeat = Heartbeat(3, ((1, 100), (2, 200), (3, 300)))
    found = [heartbeat_before(heartbeat, at) for at in (99, 100, 199, 200, 1000)]
    assert found == [None, 1, 1, 2, 3]
    assert heartbeat_before(Heartbeat(), 1000) is None


def lateness(*arrivals: tuple[int, int]) -> list[int]:
    """Return how late each picture was, by the times of source and arrival, all in ms."""
    found, it = [], Lateness()
    for source, arrived in arrivals:
        it = it.arrived(source * MS, arrived * MS)
        found.append(round(it.late_ns / MS))
    return found


def test_the_earliest_picture_is_in_time() -> None:
    assert lateness((0, 1000), (100, 1100), (200, 1350), (300, 1400)) == [0, 0, 150, 100]
    assert lateness((0, 1050), (100, 1100), (200, 1250)) == [0, 0, 50]


def test_times_that_jump_back_begin_anew() -> None:
    assert lateness((500, 1000), (600, 1300), (0, 1400), (100, 1500)) == [0, 200, 0, 0]
    assert lateness((500, 1000), (500, 1300)) == [0, 0]


def test_a_slow_clock_of_the_source_is_no_delay() -> None:
    it = Lateness()
    for second in range(3600):
        slow_ns = second * (NS_PER_S - NS_PER_S * DRIFT_PPM // 1_000_000)
        it = it.arrived(slow_ns, second * NS_PER_S)
        assert it.late_ns == 0


def test_the_drift_is_whole_nanoseconds() -> None:
    it = Lateness().arrived(0, 0).arrived(1, 3_000)
    assert it == Lateness(offset_ns=1, source_ns=1, now_ns=3_000)


def test_a_picture_that_stays_the_same_in_motion_is_as_old_as_that() -> None:
    it = Watch().seen(b"a", 1, 0.5)  # it differs from the one before
    assert (it.heartbeat, it.is_frozen) == (1, False)
    it = it.seen(b"a", 2, 0.0)  # nothing moves: it may be the same
    assert (it.heartbeat, it.is_frozen) == (2, False)
    it = it.seen(b"a", 3, 0.5)  # so little that it may be the same
    assert (it.heartbeat, it.is_frozen) == (3, False)
    it = it.seen(b"a", 4, 0.0)
    assert (it.heartbeat, it.is_frozen) == (4, False)
    it = it.seen(b"a", 5, 0.5)
    assert (it.heartbeat, it.is_frozen) == (2, True)
    it = it.seen(b"a", 6, 0.0)  # it has stopped, and is frozen still
    assert (it.heartbeat, it.is_frozen) == (2, True)
    it = it.seen(b"b", 7, 0.5)
    assert (it.heartbeat, it.is_frozen) == (7, False)
    assert it.seen(b"b", 8, 0.9).seen(b"b", 9, 0.1).heartbeat == 7


def test_a_stop_with_equal_pictures_is_not_frozen() -> None:
    it = Watch().seen(b"a", 1, 0.2)
    for heartbeat in range(2, 100):
        it = it.seen(b"a", heartbeat, 0.2 if heartbeat < 5 else 0.0)
    assert (it.heartbeat, it.is_frozen) == (99, False)
