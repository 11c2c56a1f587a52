"""An operator at a controller, and at its screen, on a bus that never opens."""

from collections.abc import Iterator

import pytest

from tests.teleop.screen_fixture import Screen
from tests.teleop.support import Operator


@pytest.fixture
def operator() -> Iterator[Operator]:
    operator = Operator()
    yield operator
    operator.node.loop.close()


@pytest.fixture
def screen() -> Iterator[Screen]:
    screen = Screen()
    yield screen
    screen.node.loop.close()
