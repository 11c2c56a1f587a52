"""What of a recording is played, and what never is."""

from fnmatch import fnmatch

import pytest

from cli.recordings.replay.plan import Aim, Choice, moves, refusal, speaker
from common import keys
from common.freshness import NS_PER_S

BEGIN_NS = 1000 * NS_PER_S
PATHS = [topic.path.format(service="odom", side="left", source="web") for topic in keys.TOPICS]


def choice(aim: Aim = "bus", **fields: object) -> Choice:
    return Choice(aim, lambda one, other: fnmatch(other, one), **fields)  # type: ignore[arg-type]


def taken(chosen: Choice, *paths: str) -> list[str]:
    return [path for path in paths if chosen.takes(path, BEGIN_NS)]


@pytest.mark.parametrize("path", ["@cmd/motion", "@cmd/drive/web", "@new", "a/@b", "estop"])
def test_nothing_that_moves_or_stops_is_played_onto_the_bus(path: str) -> None:
    assert moves(path)
    assert taken(choice(), path) == []
    assert taken(choice(only=[path]), path) == []


def test_all_else_is_played() -> None:
    assert taken(choice(), *PATHS, "tel/mine") == [*(p for p in PATHS if p[0] != "@"), "tel/mine"]


def test_a_simulator_hears_what_was_asked_and_nothing_else() -> None:
    assert taken(choice("simulator"), *PATHS, "estop", "tel/mine") == ["@cmd/drive/web", "estop"]
    assert taken(choice("simulator", only=["@cmd/motion"]), *PATHS) == []


def test_a_bridge_is_sent_every_frame() -> None:
    assert taken(choice("board"), *PATHS) == PATHS


def test_who_is_there_speaks_for_itself() -> None:
    chosen = choice(alive=["odom"])
    paths = ["tel/odom/odometry", "evt/odom", "tel/bridge/velocity", "tel/odometer/x"]
    assert taken(chosen, *paths) == ["tel/bridge/velocity", "tel/odometer/x"]


def test_keys_are_picked_and_left_out() -> None:
    paths = ["tel/odom/odometry", "tel/odom/health", "evt/odom"]
    assert taken(choice(only=["tel/*", "evt/x"]), *paths) == paths[:2]
    assert taken(choice(only=["tel/*"], skip=["*/health"]), *paths) == paths[:1]


def test_times_are_from_the_beginning_of_the_recording() -> None:
    chosen = choice(from_s=1.0, to_s=2.0)
    assert not chosen.is_over(BEGIN_NS)
    moments = [BEGIN_NS + n * NS_PER_S // 2 for n in range(6)]
    assert [chosen.takes("tel/x", at) for at in moments] == [False, False, True, True, True, False]
    assert [chosen.is_over(at) for at in moments] == [False] * 5 + [True]
    assert not choice().is_over(BEGIN_NS)


@pytest.mark.parametrize(
    ("alive", "said"),
    [
        ({"bridge"}, "bridge of robot 007 is there"),
        ({"odom", "safety"}, "safety of robot 007 is there"),
        ({"bridge", "safety"}, "bridge and safety of robot 007 is there"),
    ],
)
def test_nothing_is_played_while_somebody_acts(alive: set[str], said: str) -> None:
    assert refusal("007", alive).startswith(said)
    assert "--robot" in refusal("007", alive)


def test_others_do_not_mind() -> None:
    assert refusal("007", {"odom", "dashboard", "recorder"}) == ""


def test_whose_word_a_key_is() -> None:
    assert [speaker(path) for path in ("tel/odom/x", "evt/safety", "estop", "srv/odom/reset")] == [
        "odom", "safety", "", "",
    ]  # fmt: skip
