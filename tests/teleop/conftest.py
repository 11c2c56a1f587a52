"""An operator at a controller, on a bus that never opens."""

from collections.abc import Iterator

import pytest

from tests.teleop.support import Operator


@pytest.fixture
def operator() -> Iterator[Operator]:
    operator = Operator()
    yield operator
    operator.node.loop.close()
