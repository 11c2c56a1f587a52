"""The core of the campaign: real processes, each of the worst faults a few times.

`make faults` tries the whole catalogue, twenty times each, with the shipped limits.
"""

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from verification.faults.catalogue import FAULTS, Fault
from verification.faults.machine import HoldUps
from verification.faults.stack_fixture import Lane, lane
from verification.faults.table import Row
from verification.faults.trial import tried

pytestmark = pytest.mark.campaign

CORE = (
    "contact in one sample", "estop", "bridge SIGKILL", "bridge SIGSTOP", "guard SIGKILL",
    "safety SIGKILL", "router SIGKILL", "driver SIGKILL", "odom SIGKILL", "board not heard",
    "left driver fault", "front sonar faulty", "NaN on every key",
)  # fmt: skip
TIMES = 2
BEYOND_S = 0.5  # that a fault lasts beyond its budget


@pytest.fixture(scope="module")
def holdups() -> Iterator[HoldUps]:
    with HoldUps() as it:
        yield it


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lane]:
    with lane(tmp_path_factory.mktemp("lane"), shipped=False) as it:
        yield it


@pytest.mark.parametrize("fault", [f for f in FAULTS if f.name in CORE], ids=lambda f: f.name)
def test_the_vehicle_is_told_to_stop(stack: Lane, holdups: HoldUps, fault: Fault) -> None:
    budget_s = fault.budget(stack.stack.config) if fault.budget else None
    if budget_s is not None:  # it is longer on a slow host
        fault = replace(fault, hold_s=max(fault.hold_s, budget_s + BEYOND_S))
    samples = [tried(stack, fault) for _ in range(TIMES)]
    held = [holdups.worst_s(s.fault_ns, fault.hold_s) for s in samples]
    assert Row(fault.name, budget_s, fault.outcome, samples, held).faults == []


def test_the_rows_that_the_safety_case_names_are_in_the_catalogue() -> None:
    case = (Path(__file__).parents[3] / "docs" / "safety.md").read_text(encoding="utf-8")
    named = set(re.findall(r"faults\.md, row `([^`]+)`", case))
    assert named
    assert named <= {fault.name for fault in FAULTS}


def test_the_core_is_in_the_catalogue() -> None:
    assert {fault.name for fault in FAULTS} >= set(CORE)
    assert len({fault.name for fault in FAULTS}) == len(FAULTS)
