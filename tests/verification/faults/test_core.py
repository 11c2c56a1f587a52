"""Core of the fault campaign: real processes, each of the worst faults twice.

`make faults` runs the whole catalogue, twenty times each, with the shipped limits.
"""

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from verification.faults.catalogue import FAULTS
from verification.faults.fault import Fault
from verification.faults.stack_fixture import StackFixture, stack_fixture
from verification.faults.table import Row
from verification.faults.trial import run_trial
from verification.harness.host import StallRecorder

pytestmark = [pytest.mark.timed, pytest.mark.campaign]

CORE = (
    "contact in one sample", "estop", "bridge SIGKILL", "bridge SIGSTOP", "guard SIGKILL",
    "safety SIGKILL", "router SIGKILL", "driver SIGKILL", "odom SIGKILL", "board not heard",
    "left driver fault", "front sonar faulty", "NaN on every key",
)  # fmt: skip
TIMES = 2
BEYOND_S = 0.5  # how long a fault outlasts its budget


@pytest.fixture(scope="module")
def stalls() -> Iterator[StallRecorder]:
    with StallRecorder() as it:
        yield it


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[StackFixture]:
    with stack_fixture(tmp_path_factory.mktemp("stack"), shipped=False) as it:
        yield it


@pytest.mark.parametrize("fault", [f for f in FAULTS if f.name in CORE], ids=lambda f: f.name)
def test_the_board_receives_a_stop_in_time(
    stack: StackFixture, stalls: StallRecorder, fault: Fault
) -> None:
    budget_s = fault.budget(stack.running.config) if fault.budget else None
    if budget_s is not None:  # it is longer on a slow host
        fault = replace(fault, hold_s=max(fault.hold_s, budget_s + BEYOND_S))
    samples = [run_trial(stack, fault) for _ in range(TIMES)]
    stalls_s = [stalls.worst_s(s.fault_ns, fault.hold_s) for s in samples]
    assert Row(fault.name, budget_s, fault.outcome, samples, stalls_s).faults == []


def test_the_rows_that_the_safety_case_names_are_in_the_catalogue() -> None:
    case = (Path(__file__).parents[3] / "docs" / "safety.md").read_text(encoding="utf-8")
    named = set(re.findall(r"faults\.md, row `([^`]+)`", case))
    assert named
    assert named <= {fault.name for fault in FAULTS}


def test_the_core_is_in_the_catalogue() -> None:
    assert {fault.name for fault in FAULTS} >= set(CORE)
    assert len({fault.name for fault in FAULTS}) == len(FAULTS)
