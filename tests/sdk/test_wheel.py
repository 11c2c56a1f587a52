"""The built wheels in an empty repository that has packages of the same names as ours."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.timed

ROOT = Path(__file__).parents[2]
UV = [str(Path(sys.executable).with_name("uv")), "--quiet"]
# The host may stall: other tests run.
STALLS = {"T2__HOST__STALL": "0.3", "T2__UNSAFE_OVERRIDES": "host.stall"}
# What a program raises after a stall of 0.5 s, which no setting of the host changes.
STALLED = "t2.errors.NoData: safety is silent"
# Settings of a real robot, which are none of a simulated one.
REAL = {"T2_CONFIG": "robot.toml", "T2__ROBOT__ID": "007", "T2__BUS__CONNECT": "tcp/127.0.0.1:9"}
ENVIRONMENT = {**os.environ, **STALLS, **REAL, "PATH": os.defpath}  # without our own `t2`
ENVIRONMENT.pop("PYTHONPATH", None)
PYTHON = ".venv/bin/python"
FOREIGN = ("common", "services", "sim", "tests")
TEST = """
import pytest
import t2
from t2.pytest_plugin import robot_fixture
from common import SIDE  # of this repository


def test_forward(t2_robot: t2.Robot) -> None:
    start = t2_robot.odometry.latest().x
    with t2_robot.drive("nav") as drive:
        drive.forward(SIDE)
    assert t2_robot.odometry.latest().x - start > SIDE / 2


office = robot_fixture("office", sets=["safety.sources.mine={priority=12, lease=0.3}"])


def test_a_hit(office: t2.SimulatedRobot) -> None:
    office.simulator.place(x=1.0, y=0.0)
    assert office.simulator.truth()["x"] == 1.0
    with pytest.raises(t2.Refused):
        office.simulator.do("sonar", name="roof")
    with pytest.raises(t2.Latched), office.drive("mine") as drive:
        office.simulator.press_bumper()
        drive.forward(1.0)
    office.simulator.free_bumper()
"""
USE = """
import asyncio, t2

assert "site-packages" in t2.__file__
try:
    t2.connect("001", endpoint="tcp/127.0.0.1:9")
except t2.LinkError as error:
    print(error)
try:
    with t2.sim():
        pass
except t2.LinkError as error:
    print(error)
"""


def run(*words: str | Path, cwd: Path, tries: int = 1) -> str:
    """Run a command; return its output, and fail with it."""
    for _ in range(tries):
        done = subprocess.run(
            [str(word) for word in words], cwd=cwd, env=ENVIRONMENT, capture_output=True, text=True,
            check=False,
        )  # fmt: skip
        if STALLED not in done.stdout:
            break
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def install(repository: Path, *packages: str | Path) -> None:
    """Install packages at the locked versions."""
    options = ("--system-certs", "--python", repository / PYTHON, "-c", ROOT / "requirements.lock")
    run(*UV, "pip", "install", *options, *packages, cwd=ROOT)


def test_a_program_and_then_a_test_in_a_repository_of_its_own(tmp_path: Path) -> None:
    for project in (ROOT, ROOT / "sdk"):
        words = ("-m", "hatchling", "build", "-t", "wheel", "-d", tmp_path)
        run(sys.executable, *words, cwd=project)
    wheels = {wheel.name.partition("-")[0]: wheel for wheel in tmp_path.glob("*.whl")}
    repository = tmp_path / "repository"
    for name in FOREIGN:
        (repository / name).mkdir(parents=True)
        (repository / name / "__init__.py").write_text("SIDE = 0.3\n")
    run(*UV, "venv", "--python", sys.executable, repository / ".venv", cwd=repository)

    install(repository, wheels["t2_sdk"])
    no_router, no_stack = run(PYTHON, "-c", USE, cwd=repository).splitlines()
    assert no_router.startswith("no router answers at tcp/127.0.0.1:9")
    assert no_stack.startswith("the simulated robot needs the stack, and 't2' is not found")

    install(repository, wheels["t2"], "pytest")
    (repository / "tests/test_forward.py").write_text(TEST)
    assert "2 passed" in run(PYTHON, "-m", "pytest", "-q", cwd=repository, tries=3)
