"""The examples in the docstrings of the client library."""

import asyncio
import doctest
import importlib
import math
import time

import pytest

import t2
from tests.simulated_robot import SimulatedStack
from verification.harness.stack import RunningStack

CONNECTING = "aio", "connection"
MODULES = "drive", "patrol", "recording", "robot", "simulator", "stream", "third_party"


def examples(*modules: str) -> dict[str, doctest.DocTest]:
    """Return the examples of modules by the names that they document."""
    finder = doctest.DocTestFinder()
    found = [finder.find(importlib.import_module(f"t2.{name}")) for name in modules]
    return {
        test.name.rpartition(".")[2]: test for tests in found for test in tests if test.examples
    }


def run(test: doctest.DocTest, **names: object) -> None:
    """Run an example with these names."""
    test.globs = {"t2": t2, "asyncio": asyncio, "math": math, **names}
    report: list[str] = []
    doctest.DocTestRunner().run(test, out=report.append)
    assert not report, "".join(report)


@pytest.mark.timed
@pytest.mark.parametrize("name", examples(*CONNECTING))
@pytest.mark.usefixtures("robot")
def test_an_example_that_connects_prints_what_it_states(name: str, stack: RunningStack) -> None:
    run(examples(*CONNECTING)[name], ENDPOINT=stack.endpoint, time=time)


@pytest.mark.parametrize("name", examples(*MODULES))
def test_an_example_prints_what_it_states(
    name: str, simulated: t2.Robot, simulated_stack: SimulatedStack
) -> None:
    run(examples(*MODULES)[name], robot=simulated, time=simulated_stack.clock)


def test_every_public_name_has_an_example() -> None:
    errors = {name for name in t2.__all__ if name in vars(t2.errors)}
    assert set(t2.__all__) - errors == set(
        examples(*CONNECTING, *MODULES)
    )  # those of ``sim`` run in test_wheel.py
