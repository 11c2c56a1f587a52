"""A topic's newest value, until it is too old."""

from common import keys
from common.freshness import NS_PER_S
from common.messages import Bumper
from services.teleop.view import LatestTopic
from tests.fake_bus import FakeBus


def test_a_value_is_shown_until_it_is_too_old() -> None:
    bus = FakeBus()
    topic = LatestTopic(bus, keys.BUMPER, 0.5)
    assert topic.at(0) is None
    bus.deliver(keys.BUMPER, Bumper(pressed=True), 10 * NS_PER_S)
    assert topic.at(10 * NS_PER_S + NS_PER_S // 2) == Bumper(pressed=True)
    assert topic.at(10 * NS_PER_S + NS_PER_S // 2 + 1) is None


def test_each_side_has_its_own_topic() -> None:
    bus = FakeBus()
    LatestTopic(bus, keys.DRIVER, 2.0, side="left")
    LatestTopic(bus, keys.DRIVER, 2.0, side="right")
    assert sorted(bus.handlers) == [
        "t2/v1/001/tel/bridge/driver/left",
        "t2/v1/001/tel/bridge/driver/right",
    ]
