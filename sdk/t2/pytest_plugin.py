"""The pytest fixture ``t2_robot``, loaded by pytest itself when t2-sdk is installed."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import pytest

if TYPE_CHECKING:
    from t2.simulator import SimulatedRobot

Scope = Literal["session", "package", "module", "class", "function"]


def robot_fixture(
    world: str = "empty",
    *,
    sets: Sequence[str] = (),
    configs: Sequence[str | Path] = (),
    command: str = "t2",
    scope: Scope = "function",
) -> Callable[..., Any]:
    """Return a fixture that yields a simulated robot; ``t2.sim`` explains the options.

    >>> office = robot_fixture("office", scope="module")  # in conftest.py
    >>> def test_patrol(office): ...
    """

    @pytest.fixture(scope=scope)
    def robot() -> "Iterator[SimulatedRobot]":
        from t2.simulator import sim  # only tests that use it wait for Zenoh

        with sim(world, sets=sets, configs=configs, command=command) as it:
            yield it

    return robot


t2_robot: Callable[..., Any] = robot_fixture()
