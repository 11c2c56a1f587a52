"""Settings of the gateway that are refused before anything opens."""

import pytest

from common.config import Sources, load
from common.errors import ConfigError
from services.ros2.config import Ros2, Ros2Config


def loaded(*sets: str) -> Ros2:
    return load(Ros2Config, Sources(environ={}, sets=sets)).config.ros2


def test_the_default_file_has_the_defaults() -> None:
    assert loaded() == Ros2()


@pytest.mark.parametrize("namespace", ["/", "/t2_001", "/site/t2"])
def test_namespaces(namespace: str) -> None:
    assert loaded(f"ros2.namespace={namespace}").namespace == namespace


@pytest.mark.parametrize("namespace", ["", "t2", "/t2/", "/1", "/a-b"])
def test_a_namespace_that_ros_refuses(namespace: str) -> None:
    with pytest.raises(ConfigError, match="allowed is / or a name such as /t2_001"):
        loaded(f"ros2.namespace={namespace}")


@pytest.mark.parametrize(
    "wrong",
    [
        "domain=233", "domain=-1", "cmd_vel=none", "no_echo=nan", "sonar_fov=0", "sonar_rate=0",
        "sonar_rate=51", "frame_prefix=a b", "frame_prefix=/t2",
    ],
)  # fmt: skip
def test_a_value_that_is_not_allowed(wrong: str) -> None:
    with pytest.raises(ConfigError, match=wrong.partition("=")[0]):
        loaded(f"ros2.{wrong}")
