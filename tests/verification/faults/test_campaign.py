"""Rows of the fault campaign on real processes; `make faults` runs all of them."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from _pytest.mark import ParameterSet

from verification.faults.catalogue import FAULTS
from verification.faults.fault import Fault, run_row
from verification.faults.namespaces import step_clock
from verification.faults.stack_fixture import StackFixture, stack_fixture
from verification.harness.host import StallRecorder
from verification.harness.waiting import wait_until

pytestmark = pytest.mark.timed

BY_NAME = {fault.name: fault for fault in FAULTS}
ROWS = "contact in one sample", "safety SIGKILL"
MORE_ROWS = "estop", "bridge SIGKILL", "safety hangs, then contact"
OTHER_STACKS = (
    "driver's network cut for 3 s, then the burst", "robot's clock stepped by +1 h",
    "disk full, then contact", "relay: contact", "site: estop of all",
    "independent board: contact 0x80 on the second port",
)  # fmt: skip
SLEPT_S = 60


@pytest.fixture(scope="module")
def stalls() -> Iterator[StallRecorder]:
    with StallRecorder() as it:
        yield it


@pytest.fixture(scope="module")
def stack(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[StackFixture]:
    folder = tmp_path_factory.mktemp("stack")
    with stack_fixture(folder, shipped=False, need=request.param) as it:
        yield it


def row(name: str, *marks: pytest.MarkDecorator) -> ParameterSet:
    """Return the parameters of the test below."""
    return pytest.param(BY_NAME[name].needs, BY_NAME[name], id=name, marks=marks)


@pytest.mark.parametrize(
    ("stack", "fault"),
    [row(name) for name in ROWS] + [row(name, pytest.mark.campaign) for name in MORE_ROWS],
    indirect=["stack"],
)
def test_the_board_receives_a_stop_in_time(
    stack: StackFixture, stalls: StallRecorder, fault: Fault
) -> None:
    assert run_row(stack, fault, stalls).violations == []


@pytest.mark.skipif(not shutil.which("cc"), reason="no C compiler for the clock of the test")
def test_a_computer_that_slept_does_not_drive_on(tmp_path: Path) -> None:
    with stack_fixture(tmp_path, shipped=False, need="separate clocks") as fixture:
        fixture.ready()
        step_clock(tmp_path / "robot", SLEPT_S, SLEPT_S)
        wait_until(lambda: not fixture.moving(), "the end of the motion")
        wait_until(lambda: "estop_reader" in fixture.client.latched, "the latch")
        assert not fixture.rearm(1.0)


@pytest.mark.campaign
@pytest.mark.skipif(os.geteuid() != 0, reason="namespaces need root")
def test_the_campaign_renews_its_rows_of_the_page(tmp_path: Path) -> None:
    only = [word for name in OTHER_STACKS for word in ("--only", name)]
    out = tmp_path / "faults.md"
    out.write_text("| estop | 20 |  |  |  |  |  | after a reset | 2026-01-02 | ok |\n" * 3)
    command = [sys.executable, "-m", "verification.faults", "--repeat", "1", *only]
    command += ["--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    page = out.read_text(encoding="utf-8")
    for name in OTHER_STACKS:
        line = rf"^\| {re.escape(name)} \| 1 \|.*\| ok \|$"
        assert len(re.findall(line, page, re.MULTILINE)) == 1, name
    assert "| estop | 20 |" in page


def test_the_rows_that_the_safety_case_names_are_in_the_catalogue() -> None:
    case = (Path(__file__).parents[3] / "docs" / "safety.md").read_text(encoding="utf-8")
    named = set(re.findall(r"faults\.md, row `([^`]+)`", case))
    assert named
    assert named <= set(BY_NAME)
    assert len(BY_NAME) == len(FAULTS)
