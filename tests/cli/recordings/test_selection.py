"""Selection of the messages to replay."""

from fnmatch import fnmatch

import pytest

from cli.recordings.selection import Selection, moves, publisher, refusal
from common import keys
from common.freshness import NS_PER_S

BEGIN_NS = 1000 * NS_PER_S
PATHS = [topic.path.format(service="odom", side="left", source="web") for topic in keys.TOPICS]


def selection(**fields: object) -> Selection:
    return Selection(lambda one, other: fnmatch(other, one), **fields)  # type: ignore[arg-type]


def taken(chosen: Selection, *paths: str) -> list[str]:
    return [path for path in paths if chosen.includes(path, BEGIN_NS)]


@pytest.mark.parametrize("path", ["@cmd/motion", "@cmd/drive/web", "@new", "a/@b", "estop"])
def test_actuation_keys_are_not_played_onto_the_bus(path: str) -> None:
    assert moves(path)
    assert taken(selection(), path) == []
    assert taken(selection(only=[path]), path) == []


def test_other_keys_are_played() -> None:
    assert taken(selection(), *PATHS, "tel/mine") == [
        *(p for p in PATHS if p[0] != "@"),
        "tel/mine",
    ]


def test_a_bridge_receives_every_frame() -> None:
    assert taken(selection(frames=True), *PATHS) == PATHS


def test_streams_of_running_services_are_not_played() -> None:
    chosen = selection(alive=["odom"])
    paths = ["tel/odom/odometry", "evt/odom", "tel/bridge/velocity", "tel/odometer/x"]
    assert taken(chosen, *paths) == ["tel/bridge/velocity", "tel/odometer/x"]


def test_only_and_skip() -> None:
    paths = ["tel/odom/odometry", "tel/odom/health", "evt/odom"]
    assert taken(selection(only=["tel/*", "evt/x"]), *paths) == paths[:2]
    assert taken(selection(only=["tel/*"], skip=["*/health"]), *paths) == paths[:1]


def test_times_are_relative_to_the_start_of_the_recording() -> None:
    chosen = selection(from_s=1.0, to_s=2.0)
    assert not chosen.is_over(BEGIN_NS)
    moments = [BEGIN_NS + n * NS_PER_S // 2 for n in range(6)]
    assert [chosen.includes("tel/x", at) for at in moments] == [
        False,
        False,
        True,
        True,
        True,
        False,
    ]
    assert [chosen.is_over(at) for at in moments] == [False] * 5 + [True]
    assert not selection().is_over(BEGIN_NS)


@pytest.mark.parametrize(
    ("alive", "message"),
    [
        ({"bridge"}, "bridge of robot 007 is running"),
        ({"odom", "safety"}, "safety of robot 007 is running"),
        ({"bridge", "safety"}, "bridge and safety of robot 007 are running"),
        ({"odom", "dashboard", "recorder"}, ""),
    ],
)
def test_replay_is_refused_while_bridge_or_safety_run(alive: set[str], message: str) -> None:
    why = refusal("007", alive)
    assert why.startswith(message)
    assert ("--robot" in why) is bool(message)


def test_publisher_of_a_key() -> None:
    paths = ("tel/odom/x", "evt/safety", "estop", "srv/odom/reset")
    assert [publisher(path) for path in paths] == ["odom", "safety", "", ""]
