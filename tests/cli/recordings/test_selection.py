"""Selection of the messages to replay."""

import pytest

from cli.recordings.selection import is_played, refusal
from common import keys

PATHS = [topic.path.format(service="odom", side="left", source="web") for topic in keys.TOPICS]


@pytest.mark.parametrize("path", ["@cmd/motion", "@cmd/drive/web", "@new", "a/@b", "estop"])
def test_actuation_keys_are_not_played_onto_the_bus(path: str) -> None:
    assert not is_played(path, ())


def test_other_keys_are_played() -> None:
    assert [path for path in PATHS if not is_played(path, ())] == [p for p in PATHS if p[0] == "@"]
    assert is_played("tel/mine", ())


def test_streams_of_running_services_are_not_played() -> None:
    paths = ["tel/odom/odometry", "evt/odom", "tel/bridge/velocity", "tel/odometer/x", "srv/odom"]
    assert [is_played(path, ["odom"]) for path in paths] == [False, False, True, True, True]


@pytest.mark.parametrize(
    ("alive", "named"),
    [
        ({"odom", "safety"}, "robot 007 has a running safety: "),
        ({"bridge", "safety"}, "robot 007 has a running bridge and safety: "),
        ({"odom", "dashboard", "recorder"}, ""),
    ],
)
def test_replay_is_refused_while_bridge_or_safety_run(alive: set[str], named: str) -> None:
    why = refusal("007", alive)
    assert why.startswith(named)
    assert bool(why) is bool(named)
