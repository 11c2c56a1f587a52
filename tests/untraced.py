"""Code of tests that no coverage is measured of."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def untraced() -> Iterator[None]:
    """Leave what runs here out of the coverage, also as a decorator.

    Before Python 3.12 all code takes several times as long while it is traced. The pause of
    pytest-cov is not enough: in a worker it leaves a second tracer running.
    """
    tracer = sys.gettrace()
    sys.settrace(None)
    try:
        yield
    finally:
        sys.settrace(tracer)
