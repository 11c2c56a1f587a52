"""Settings of the gateway that contradict each other."""

import pytest

from common.config import Sources, load
from common.errors import ConfigError
from services.ros2.config import Ros2Config

LISTED = "localization.sources.amcl={sigma = 0.1}"


def test_fixes_are_of_sources_that_localization_lists() -> None:
    sets = ["localization.lost_sigma=2.0", LISTED, "ros2.fixes.amcl=/amcl_pose"]
    config = load(Ros2Config, Sources(files=(), environ={}, sets=sets)).config
    assert config.ros2.fixes == {"amcl": "/amcl_pose"}


@pytest.mark.parametrize(
    ("sets", "reason"),
    [
        (("ros2.fixes.amcl=/amcl_pose",), "ros2.fixes names 'amcl', which localization.sources"),
        (("ros2.fixes.amcl=/a", "localization.sources=amcl"), "localization.sources does not list"),
        ((LISTED, "ros2.fixes.amcl=/"), "fixes.amcl is '/', allowed is a topic"),
        ((LISTED, "ros2.fixes.amcl=/a b"), "fixes.amcl is '/a b', allowed is a topic"),
        ((LISTED, "ros2.fixes.amcl=map_pose"), "fixes.amcl: /map_pose is the robot's own pose"),
        (
            (LISTED, "ros2.fixes.amcl=/a", "ros2.fixes.tags=a"),
            "fixes names /a twice: each pose would count twice",
        ),
        (("ros2.fixes.AMCL=/a",), "ros2.fixes"),
        (("ros2.publish_tf=false", "ros2.publish_map_tf=true"), "publish_map_tf needs publish_tf"),
    ],
)
def test_what_contradicts_is_refused(sets: tuple[str, ...], reason: str) -> None:
    with pytest.raises(ConfigError, match=reason):
        load(Ros2Config, Sources(files=(), environ={}, sets=sets))
