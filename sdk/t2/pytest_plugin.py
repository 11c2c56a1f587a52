"""The pytest fixture ``t2_robot``, loaded by pytest itself when t2-sdk is installed."""

from collections.abc import Iterator

import pytest

from t2.robot import Robot
from t2.sim import sim


@pytest.fixture
def t2_robot() -> Iterator[Robot]:
    """Yield a simulated robot that is ready to drive; ``t2.sim`` has options.

    >>> def test_lap(t2_robot):
    ...     with t2_robot.drive("nav") as drive:
    ...         drive.forward(1.0)
    """
    with sim() as robot:
        yield robot
