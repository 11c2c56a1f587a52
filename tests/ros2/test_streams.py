"""Poses in the map as topics of ROS 2, on a fake bus."""

import random
from collections import defaultdict
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from common import clock
from services.ros2 import translate
from services.ros2.config import Ros2, Ros2Config
from services.ros2.streams import Streams
from t2 import keys
from t2 import messages as m
from tests import factories
from tests.fake_bus import FakeNode

PERIOD_NS = 40_000_000
MAP, ODOM = ("map", "odom"), ("odom", "base_link")


class Robot:
    """The streams of a gateway, and what they have published by topic."""

    def __init__(self, **settings: Any) -> None:
        self.node = FakeNode("ros2", Ros2Config(ros2=Ros2(**settings)))
        self.sent: dict[str, list[Any]] = defaultdict(list)
        Streams(self.node, self._publisher, translate.Diagnostics())

    def _publisher(self, topic: str, _: str, *, kept: int = 0) -> Any:
        sent = self.sent[topic]

        class Publisher:
            def put(self, message: Any) -> None:
                sent.append(message)

        return Publisher()

    def odometry(self, seq: int) -> None:
        self.node.fake.deliver(keys.ODOMETRY, odometry(seq), clock.now_ns() + seq * PERIOD_NS)

    def pose(self, seq: int, state: m.MapState = "placed", x: float | None = 1.0) -> None:
        """Deliver the pose that follows from an odometry message; without x there is none."""
        frame = None if x is None else m.PlaneFrame(x=x, y=0.0, heading=0.0)
        covariance = None if x is None else (0.0,) * 9
        message = m.MapPose(
            state=state, x=x, y=x, heading=x, pose_covariance=covariance, odom=frame,
            odom_boot=9, odom_seq=seq, placement=1, text="", t_ns=1,
        )  # fmt: skip
        self.node.fake.deliver(keys.MAP_POSE, message)

    def transforms(self) -> list[tuple[tuple[str, str], int]]:
        """Return the frames of each transform, with the number of the odometry of its stamp."""
        made = []
        for ((header, child, _),) in (each[0] for each in self.sent["/tf"]):
            (seconds, nanoseconds), parent = header
            made.append(((parent, child), (seconds * 10**9 + nanoseconds) // PERIOD_NS))
        return made


@pytest.fixture
def robots() -> Iterator[Callable[..., Robot]]:
    made: list[Robot] = []

    def make(**settings: Any) -> Robot:
        made.append(Robot(**settings))
        return made[-1]

    yield make
    for each in made:
        each.node.loop.close()


def odometry(seq: int) -> m.Odometry:
    return factories.odometry(boot=9, seq=seq, t_ns=seq * PERIOD_NS)


def test_the_map_has_the_stamps_of_odometry_while_there_is_a_pose(
    robots: Callable[..., Robot],
) -> None:
    robot = robots(publish_map_tf=True)
    for seq, state, x in ((1, "unplaced", None), (2, "placed", 1.0), (3, "lost", 1.0)):
        robot.odometry(seq)
        robot.pose(seq, state, x)  # type: ignore[arg-type]
    assert robot.transforms() == [(ODOM, 1), (ODOM, 2), (MAP, 2), (ODOM, 3), (MAP, 3)]
    assert len(robot.sent["map_pose"]) == 2


def test_a_stamp_comes_once_and_only_of_odometry_that_was_published(
    robots: Callable[..., Robot],
) -> None:
    robot = robots(publish_map_tf=True)
    robot.odometry(1)
    robot.pose(1)
    robot.pose(1)  # after a placement
    robot.pose(2)
    assert robot.transforms() == [(ODOM, 1), (MAP, 1)]
    assert len(robot.sent["map_pose"]) == 1


def test_no_odometry_is_lost_and_faster_streams_are_thinned_by_phase(
    robots: Callable[..., Robot],
) -> None:
    robot, draw = robots(), random.Random(1)
    streams: tuple[tuple[keys.Topic[Any], m.Message, int], ...] = (
        (keys.ODOMETRY, factories.odometry(), 25),
        (keys.ULTRASONIC, m.Ultrasonic(ranges=(1.0,) * 8, status=("ok",) * 8), 20),
        (keys.BUMPER, m.Bumper(pressed=False), 50),
    )
    for topic, message, rate in streams:
        for number in range(20 * rate):
            at_ns = round((number + draw.uniform(0.0, 0.4)) * 1e9 / rate)  # arrivals jitter
            robot.node.fake.deliver(topic, message, at_ns)
    assert len(robot.sent["odom"]) == len(robot.sent["/tf"]) == 20 * 25
    for thinned in ("sonar_front/range", "bumper"):
        assert len(robot.sent[thinned]) == pytest.approx(20 * 10, abs=2)


@pytest.mark.parametrize(("settings", "frames"), [({}, [ODOM]), ({"publish_tf": False}, [])])
def test_by_default_another_node_publishes_the_map(
    settings: dict[str, bool], frames: list[tuple[str, str]], robots: Callable[..., Robot]
) -> None:
    robot = robots(**settings)
    robot.odometry(1)
    robot.pose(1)
    assert [each for each, _ in robot.transforms()] == frames
    assert len(robot.sent["map_pose"]) == 1
