"""The programs of docs/integrate.md, as they stand there, on the real stack."""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from common.bus.bus import Bus
from common.loop import Loop
from common.source import DriveSource
from sim.requests import Bumper
from tests.docs.integrator import (
    PAGE,
    ROOT,
    Integrator,
    check_driving,
    check_limiting,
    check_reading,
    check_silent_safety,
    lines_until,
    running_integrator,
    save_files,
)
from verification.harness.bus import bus_on, running
from verification.harness.ports import free_port
from verification.harness.waiting import wait_until

pytestmark = pytest.mark.timed

NOT_OBEYED = "safety does not obey patrol:"
PYTHON = pytest.mark.parametrize("way", ["plain", "sdk"])
TEXT = PAGE.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Integrator]:
    with running_integrator(tmp_path_factory.mktemp("integrate")) as it:
        yield it


@pytest.fixture
def it(shared: Integrator) -> Integrator:
    return shared


def test_the_first_program_prints_the_pose(it: Integrator) -> None:
    with it.running("first.py") as process:
        (line,) = lines_until(process, lambda line: True)
    assert "'child_frame_id': 'base_link'" in line


@PYTHON
def test_a_consumer(it: Integrator, way: str) -> None:
    check_reading(it, f"{way}/read.py")


@PYTHON
def test_a_source(it: Integrator, way: str) -> None:
    check_driving(it, f"{way}/drive.py")


@PYTHON
def test_a_limit(it: Integrator, way: str) -> None:
    check_limiting(it, f"{way}/limit.py")


def test_a_vehicle_without_its_limit_does_not_drive(it: Integrator) -> None:
    wait_until(lambda: it.limit().silent, "no limit")
    before = it.stack.control.truth().x
    it.check_failure(f"{NOT_OBEYED} No speed limit arrives of detector.", "plain/drive.py")
    assert it.stack.control.truth().x == pytest.approx(before, abs=0.01)


def test_a_killed_source_stops_the_vehicle(it: Integrator) -> None:
    with it.limited("plain/limit.py"):
        with it.moving("plain/drive.py"):
            pass
        wait_until(lambda: "no_request" in it.causes(), "the cause")
        assert it.robot.safety.latest().source is None
        wait_until(lambda: it.stack.speed() < 0.02, "a stop")


@PYTHON
def test_a_source_ends_when_safety_dies(it: Integrator, way: str) -> None:
    check_silent_safety(it, f"{way}/drive.py")


@pytest.mark.parametrize(
    ("way", "reported"),
    [
        ("plain", "safety does not obey patrol: The bumper was hit."),
        ("sdk", "Latched: The bumper was hit."),
    ],
)
def test_a_latched_vehicle(it: Integrator, way: str, reported: str) -> None:
    with it.limited("plain/limit.py"):
        it.stack.control.do(Bumper(pressed=True))
        try:
            wait_until(lambda: "contact" in it.robot.safety.latest().latched, "the contact")
            it.check_failure(reported, f"{way}/drive.py")
        finally:
            it.stack.control.do(Bumper(pressed=False))
        it.await_clear()


@pytest.mark.parametrize(
    ("way", "reported"),
    [
        ("plain", "safety does not obey patrol: teleop drives"),
        ("sdk", "Overruled: overruled by teleop"),
    ],
)
def test_an_overruled_source(it: Integrator, way: str, reported: str) -> None:
    def declare(bus: Bus) -> None:
        teleop = DriveSource(bus, "teleop")
        loop.post(lambda: loop.every(0.05, lambda _: teleop.request(0.0, 0.0)))

    with (
        it.limited("plain/limit.py"),
        running(Loop()) as loop,
        bus_on(it.stack.endpoint, loop, declare),
    ):
        wait_until(lambda: it.robot.safety.latest().source == "teleop", "the operator")
        it.check_failure(reported, f"{way}/drive.py")


@pytest.mark.parametrize(
    ("way", "reported"),
    [("plain", "safety does not obey stranger: safety.sources or "), ("sdk", "NotAllowed: ")],
)
def test_an_unknown_source(it: Integrator, way: str, reported: str) -> None:
    program = (it.folder / way / "drive.py").read_text(encoding="utf-8")
    (it.folder / way / "stranger.py").write_text(program.replace("patrol", "stranger"))
    with it.limited("plain/limit.py"):
        it.check_failure(reported, f"{way}/stranger.py")


def test_two_programs_with_one_name(it: Integrator) -> None:
    with (
        it.limited("plain/limit.py"),
        it.running("plain/drive.py"),
        it.running("sdk/drive.py"),
    ):
        wait_until(lambda: "two_publishers" in it.causes(), "the conflict")


def test_no_router(it: Integrator) -> None:
    done = it.run("sdk/drive.py", router=f"tcp/127.0.0.1:{free_port()}")
    assert done.returncode == 1
    assert done.stderr.startswith("LinkError: no router answers at ")


def test_the_command_that_shows_the_text_of_safety(it: Integrator) -> None:
    (line,) = re.findall(r"^T2/\.venv/bin/t2 (echo .*)$", TEXT, re.MULTILINE)
    words = [
        sys.executable,
        "-m",
        "cli",
        *line.split(),
        "--set",
        f"bus.connect={it.stack.endpoint}",
    ]

    def shown() -> str:
        return subprocess.run(
            words, cwd=ROOT, capture_output=True, text=True, check=True, timeout=60
        ).stdout.strip()

    wait_until(lambda: shown() == it.robot.safety.latest().text, "the text", 60.0)


def test_the_version_of_zenoh_is_that_of_the_stack() -> None:
    (locked,) = re.findall(
        r"^eclipse-zenoh==(\S+)", (ROOT / "requirements.lock").read_text(encoding="utf-8"), re.M
    )
    assert re.findall(r"eclipse-zenoh==(\S+)", TEXT) == [locked]


def test_the_programs_are_formatted(tmp_path: Path) -> None:
    save_files(PAGE, tmp_path)
    words = ["format", "--check", "--isolated", "--line-length", "100", str(tmp_path)]
    done = subprocess.run(
        [sys.executable, "-m", "ruff", *words], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout
