"""The examples in the client library's docstrings, on the real stack."""

import asyncio
import doctest
import importlib
import math
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import t2
from tools import sdk
from verification.harness.stack import RunningStack

pytestmark = pytest.mark.timed

MODULES = ("aio", "connection", "drive", "limit", "robot", "stream")
FOUND = [doctest.DocTestFinder().find(importlib.import_module(f"t2.{name}")) for name in MODULES]
EXAMPLES = [test for tests in FOUND for test in tests if test.examples]


@pytest.mark.parametrize("test", EXAMPLES, ids=lambda test: test.name)
def test_an_example_prints_what_it_states(
    test: doctest.DocTest, robot: t2.Robot, stack: RunningStack
) -> None:
    test.globs = {
        "t2": t2, "robot": robot, "ENDPOINT": stack.endpoint, "asyncio": asyncio,
        "math": math, "threading": threading, "time": time,
    }  # fmt: skip
    report: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    runner.run(test, out=report.append)
    assert not report, "".join(report)


def test_every_public_function_has_an_example() -> None:
    without = [
        name
        for module in MODULES
        for name in public_functions(sdk.SDK / f"{module}.py")
        if not any(test.name == f"t2.{name}" for test in EXAMPLES)
    ]
    assert without == [
        "aio.AsyncRobot.drive", "aio.AsyncRobot.reset",  # their docstrings name where it is
    ]  # fmt: skip


def public_functions(file: Path) -> Iterator[str]:
    """Yield the functions and methods that programs call."""
    module = importlib.import_module(f"t2.{file.stem}")
    for name, value in vars(t2).items():
        if getattr(value, "__module__", "") != module.__name__:
            continue
        if isinstance(value, type):
            members = vars(value).items()
            yield from (
                f"{file.stem}.{name}.{member}"
                for member, function in members
                if callable(function) and not member.startswith("_") and member not in INTERNAL
            )
        else:
            yield f"{file.stem}.{name}"


INTERNAL = {"open", "reading", "after"}  # for the library's own modules
