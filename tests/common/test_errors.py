"""The tree of errors."""

import pytest

from common.errors import ConfigError, LinkError, MessageError, RobotError, WireError


@pytest.mark.parametrize("kind", [WireError, MessageError, ConfigError, LinkError])
def test_all_that_goes_wrong_is_a_robot_error(kind: type[RobotError]) -> None:
    assert issubclass(kind, RobotError)
    assert not issubclass(kind, (OSError, ValueError))
