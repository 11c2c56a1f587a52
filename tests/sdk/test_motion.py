"""Motions: their speeds and progress, and paths by a vehicle that obeys late, in simulated time."""

import math
import random
from collections import deque
from collections.abc import Callable, Sequence

import pytest

from t2.messages import Odometry
from t2.motion import Arc, Motion, Path, Progress, Straight, Turn

PERIOD_S, LATE, PATIENCE = 0.05, 4, 2400  # samples that a request is late; samples for a path

Points = Sequence[tuple[float, float]]


def pose(x: float, y: float, heading: float) -> Odometry:
    return Odometry(
        x=x, y=y, heading=heading, linear=0.0, angular=0.0, epoch=0, residual=None, slip=False,
        pose_covariance=(0.0,) * 9, twist_covariance=(0.0,) * 4,
    )  # fmt: skip


def end_of(points: Points) -> tuple[float, float]:
    """Drive a path from the origin; return where it ends."""
    x = y = heading = 0.0
    path = Path(pose(x, y, heading), points, 0.3, 0.5)
    requests = deque([(0.0, 0.0)] * LATE)
    for _ in range(PATIENCE):
        here = pose(x, y, heading)
        left = path.left(here)
        if left <= path.near:
            return x, y
        requests.append(path.velocity(here, left))
        linear, angular = requests.popleft()
        x += linear * PERIOD_S * math.cos(heading)
        y += linear * PERIOD_S * math.sin(heading)
        heading = math.remainder(heading + angular * PERIOD_S, math.tau)
    raise AssertionError(f"the path does not end: {points}")


RANDOM = random.Random(1)
PATHS = [
    [(1.0, 0.0), (0.0, 0.0)],  # back on the same line
    [(1.0, 0.0), (0.5, 0.1)],
    [(0.1, 0.0), (0.1, 0.1), (0.0, 0.1), (0.0, 0.0)],
    [(-1.0, 0.0)],
    [(0.5, 0.0), (0.5, 0.0), (1.0, 0.5)],
    *([(RANDOM.uniform(-1, 1), RANDOM.uniform(-1, 1)) for _ in range(4)] for _ in range(100)),
]


@pytest.mark.parametrize("points", PATHS)
def test_a_path_with_any_corners_ends_at_its_last_point(points: Points) -> None:
    assert math.dist(end_of(points), points[-1]) < 0.1


def test_a_turn_within_a_path_is_shown_until_it_ends() -> None:
    path = Path(pose(0.0, 0.0, 0.0), [(-1.0, 0.0)], 0.3, 0.5)
    assert path.left(pose(0.0, 0.0, 0.0)) == 1.0
    for heading in (0.0, 2.0, 3.0):
        assert path.velocity(pose(0.0, 0.0, heading), 1.0)[0] == 0.0
        assert path.turning == pytest.approx(math.pi - heading)
    assert path.velocity(pose(0.0, 0.0, 3.1), 1.0)[0] > 0.0
    assert path.turning == 0.0


def test_a_path_without_a_length_has_ended() -> None:
    assert Path(pose(0.0, 0.0, 0.0), [(0.0, 0.0)], 0.3, 0.5).left(pose(0.0, 0.0, 0.0)) == 0.0


ORIGIN = pose(0.0, 0.0, 0.0)
MOTIONS: dict[str, Callable[[float], Motion]] = {
    "forward": lambda speed: Straight(ORIGIN, 1.0, speed),
    "backward": lambda speed: Straight(ORIGIN, -1.0, speed),
    "turn": lambda speed: Turn(ORIGIN, -1.0, speed),
    "arc": lambda speed: Arc(ORIGIN, 0.5, 1.0, speed),
    "follow": lambda speed: Path(ORIGIN, [(1.0, 0.1)], speed, 0.5),
}


@pytest.mark.parametrize("speed", [0.0018, 0.0026, 0.02, 0.03, 0.3, 1.0])
@pytest.mark.parametrize("name", MOTIONS)
def test_no_motion_is_faster_than_asked(name: str, speed: float) -> None:
    motion = MOTIONS[name](speed)
    unit = math.radians(0.1) if name == "turn" else 0.001  # of the board's commands
    for left in (1.0, 0.1, 0.011, 1e-3, 0.0):
        requested = abs(motion.velocity(ORIGIN, left)[name == "turn"])
        assert 0 < round(requested / unit) * unit <= speed


@pytest.mark.parametrize("name", MOTIONS)
def test_a_speed_that_the_board_cannot_do_is_refused(name: str) -> None:
    for speed in (0.0009, 1e-9):
        with pytest.raises(ValueError, match=r"speed must be at least|turns less than 0\.1 deg/s"):
            MOTIONS[name](speed)


def test_an_arc_that_the_board_would_drive_straight_is_refused() -> None:
    with pytest.raises(ValueError, match=r"an arc of 1000 m at 0\.3 m/s turns less than"):
        Arc(ORIGIN, 1000.0, 0.1, 0.3)
    arc = Arc(ORIGIN, 50.0, 0.1, 0.3)
    assert arc.velocity(ORIGIN, 0.0)[1] >= math.radians(0.1) - 1e-9


@pytest.mark.parametrize(("speed", "patience"), [(0.001, 0.0), (0.05, 0.1), (0.3, 3.0)])
def test_a_slow_motion_is_no_blocked_one(speed: float, patience: float) -> None:
    begin_s = 0.4  # the vehicle begins to move
    progress = Progress(Straight(ORIGIN, 0.2, speed), patience, 60.0, 0.0)
    for sample in range(100):
        now_s = sample * 0.04
        moved = speed * max(0.0, now_s - begin_s)
        assert not progress.ends(0.2 - moved, 0.0, now_s, waits=False)
    assert progress.ends(0.2 - moved, 0.0, now_s + patience + 1.5 + 0.04, waits=False)


def test_the_wait_for_the_end_of_a_stop_is_no_lack_of_progress_for_its_time() -> None:
    progress = Progress(Straight(ORIGIN, 0.2, 0.3), 1.0, 60.0, 0.0)
    assert not progress.ends(0.2, 0.0, 0.0, waits=False)
    assert not progress.ends(0.2, 0.0, 59.0, waits=True)
    assert not progress.ends(0.2, 0.0, 60.0, waits=False)
    assert not progress.ends(0.2, 0.0, 60.0, waits=True)
    assert progress.ends(0.2, 0.0, 60.1, waits=False)
