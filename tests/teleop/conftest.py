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
def screen(request: pytest.FixtureRequest) -> Iterator[Screen]:
    """Return a screen; its parameter is the language."""
    screen = Screen(getattr(request, "param", "en"))
    yield screen
    screen.node.loop.close()
