"""The examples in the client library's docstrings, on the real stack."""

import asyncio
import doctest
import importlib
import math
import time

import pytest

import t2
from verification.harness.stack import RunningStack

pytestmark = pytest.mark.timed

MODULES = "aio", "connection", "drive", "recording", "robot", "simulator", "stream", "third_party"
FOUND = [doctest.DocTestFinder().find(importlib.import_module(f"t2.{name}")) for name in MODULES]
EXAMPLES = {
    test.name.rpartition(".")[2]: test for tests in FOUND for test in tests if test.examples
}


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_prints_what_it_states(name: str, robot: t2.Robot, stack: RunningStack) -> None:
    test = EXAMPLES[name]
    test.globs = {
        "t2": t2, "robot": robot, "ENDPOINT": stack.endpoint, "asyncio": asyncio, "math": math,
        "time": time,
    }  # fmt: skip
    report: list[str] = []
    doctest.DocTestRunner().run(test, out=report.append)
    assert not report, "".join(report)


def test_every_public_name_has_an_example() -> None:
    errors = {name for name in t2.__all__ if name in vars(t2.errors)}
    assert set(t2.__all__) - errors == set(EXAMPLES)  # those of ``sim`` run in test_wheel.py
