"""Waiting until a condition becomes true."""

import time
from collections.abc import Callable
from typing import TypeVar

PATIENCE_S = 20.0
T = TypeVar("T")


def wait_until(true: Callable[[], T], what: str, patience_s: float = PATIENCE_S) -> T:
    """Return the first true result; raise AssertionError with ``what`` after the timeout."""
    deadline = time.monotonic() + patience_s
    while not (found := true()):
        if time.monotonic() > deadline:
            raise AssertionError(f"waited {patience_s:.0f} s for: {what}")
        time.sleep(0.005)
    return found


def becomes_true(true: Callable[[], object], patience_s: float) -> bool:
    """Return whether the condition becomes true within the timeout."""
    end_s = time.monotonic() + patience_s
    while time.monotonic() < end_s:
        if true():
            return True
        time.sleep(0.004)
    return False
