"""The programs of docs/integrate.md, copied as it says, on the real stack."""

import os
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
import zenoh

from common.bus.session import client_config
from tests.docs.integrator import ROOT, Integrator, running_integrator
from verification.harness.bus import at
from verification.harness.waiting import wait_until

pytestmark = pytest.mark.timed

TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "out" / "rust"))
RUST_MARKS = pytest.mark.skipif(
    not (TARGET / "debug" / "drive").exists(), reason="not compiled: make rust-example"
)

PROGRAMS = [
    "plain",
    pytest.param("sdk", marks=pytest.mark.campaign),
    pytest.param("rust", marks=RUST_MARKS),
]
Programs = dict[str, str]


@pytest.fixture(scope="module")
def it(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Integrator]:
    with running_integrator(tmp_path_factory.mktemp("integrate")) as it:
        yield it


@pytest.fixture(scope="module", params=PROGRAMS)
def programs(request: pytest.FixtureRequest) -> Programs:
    """Return the three programs in one language."""
    names = ("read", "drive", "limit")
    if request.param == "sdk":
        library = "nearest_obstacle.py", "shuttle.py", "limit_speed.py"
        return dict(zip(names, library, strict=True))
    if request.param == "rust":
        return {name: str(TARGET / "debug" / name) for name in names}
    return {name: f"plain/{name}.py" for name in names}


def line_with(process: "subprocess.Popen[str]", text: str) -> str:
    """Return the next line of a program's output that contains a text."""
    assert process.stdout is not None
    return next(line for line in process.stdout if text in line)


def test_the_first_program_prints_the_pose(it: Integrator) -> None:
    with it.running("first.py") as process:
        assert line_with(process, "'child_frame_id': 'base_link'")


def test_a_program_publishes_on_a_key_of_its_own(it: Integrator) -> None:
    key = "t2/v1/001/app/planner/route"
    where = client_config(at(it.stack.endpoint))
    with zenoh.open(where) as session, it.running("plain/publish.py"):
        newest = session.declare_subscriber(key, zenoh.handlers.RingChannel(1))
        sample = newest.recv()
    assert str(sample.encoding) == "application/msgpack"
    assert msgspec.msgpack.decode(sample.payload.to_bytes())["next"] == [1.5, 0.0]


def test_a_consumer_prints_pose_and_nearest_obstacle(it: Integrator, programs: Programs) -> None:
    place = it.robot.odometry.latest()
    with it.obstacle(0.62), it.running(programs["read"]) as process:
        line = line_with(process, "nearest 0.6")
    number = r"(-?\d+\.\d\d)"
    found = re.match(rf"x {number} m  y {number} m  heading {number} rad  nearest 0\.6\d m", line)
    assert found
    pose = [float(text) for text in found.groups()]
    assert pose == pytest.approx([place.x, place.y, place.heading], abs=0.05)


def test_a_source_drives(it: Integrator, programs: Programs) -> None:
    with it.limited("plain/limit.py"):
        it.check_drive(programs["drive"])


def test_a_source_ends_when_safety_dies(it: Integrator, programs: Programs) -> None:
    with it.limited("plain/limit.py"), it.running(programs["drive"]) as process:
        wait_until(lambda: it.stack.speed() > 0.1, "motion")
        it.stack.kill("safety")
        try:
            assert process.wait(timeout=20.0) == 1
        finally:
            it.stack.start("safety")


def test_a_limit_caps_the_speed_and_its_end_stops(it: Integrator, programs: Programs) -> None:
    with it.limited(programs["limit"]) as process:
        assert it.limit().linear is None
        with it.obstacle(1.0):
            wait_until(lambda: it.limit().linear == 0.1, "the cap")
            wait_until(lambda: it.limit().reason.startswith("obstacle at "), "its reason")
        wait_until(lambda: it.limit().linear is None, "no cap")
        process.kill()
        wait_until(lambda: it.limit().silent, "the stop")
