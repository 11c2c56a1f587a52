"""Every example once, as a process on the real stack."""

import asyncio
import csv
import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from itertools import repeat
from pathlib import Path
from threading import Thread
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

import t2
from cli.settings import Everything
from examples import limit_speed, nearest_obstacle, wall_follower
from sim.requests import Bumper, Sonar
from t2.messages import Ultrasonic
from tests.sdk.library_robot import blocked, ready
from verification.harness.bus import set_options
from verification.harness.stack import RunningStack, running_stack
from verification.harness.waiting import PATIENCE_S, wait_until

pytestmark = pytest.mark.timed

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
ENVIRONMENT = os.environ | {"PYTHONPATH": str(ROOT / "sdk")}
SETS = ("safety.sources.agent={priority=1, lease=0.3, operator=false}",)


def beside(config: Everything) -> dict[str, list[str]]:
    """Return the command of a localization that tags may place."""
    router = f"bus.connect=['{config.bus.endpoints[0]}']"
    sets = set_options(router, "localization.sources.tags={places=true}")
    return {"localization": [sys.executable, "-m", "services.localization", *sets]}


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningStack]:
    with running_stack(
        tmp_path_factory.mktemp("examples"), "office", sets=SETS, beside=beside
    ) as it:
        yield it


@pytest.fixture
def robot(stack: RunningStack) -> Iterator[t2.Robot]:
    with ready(stack) as it:
        yield it


@contextmanager
def example(*words: str) -> Iterator["subprocess.Popen[str]"]:
    """Run an example; stop it like Ctrl-C, and expect a good end."""
    with subprocess.Popen(
        [sys.executable, *words], cwd=ROOT, env=ENVIRONMENT, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            yield process
            process.send_signal(signal.SIGINT)
            assert process.wait(PATIENCE_S) == 0
        finally:
            process.kill()


def line_of(process: "subprocess.Popen[str]") -> str:
    assert process.stdout is not None
    return process.stdout.readline()


def test_the_logger_writes_poses(robot: t2.Robot, tmp_path: Path) -> None:
    file = tmp_path / "poses.csv"
    with example("examples/odometry_logger.py", str(file), robot.endpoint):
        wait_until(lambda: file.exists() and file.read_text().count("\n") > 5, "poses")
    rows = list(csv.DictReader(file.read_text().splitlines()))
    assert float(rows[0]["x"]) == pytest.approx(robot.odometry.latest().x, abs=0.05)


@pytest.mark.campaign
def test_the_square_ends_at_its_start(robot: t2.Robot) -> None:
    with example("examples/square.py", robot.endpoint) as process:
        distance, _, rest = line_of(process).partition(" ")
        assert process.wait(PATIENCE_S) == 0
    assert float(distance) < 0.3
    assert rest == "m from the start\n"


@pytest.mark.campaign
def test_the_notebook_plots_while_it_drives(
    robot: t2.Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("T2_ENDPOINT", robot.endpoint)
    monkeypatch.setenv("PYTHONPATH", ENVIRONMENT["PYTHONPATH"])
    notebook = nbformat.read(  # type: ignore[no-untyped-call]
        EXAMPLES / "live_plot.ipynb", as_version=4
    )
    NotebookClient(notebook, timeout=100, resources={"metadata": {"path": tmp_path}}).execute()
    plots = notebook.cells[-2].outputs
    assert any("image/png" in output.get("data", {}) for output in plots)


def test_the_agent_drives_and_stops_and_never_resets(robot: t2.Robot, stack: RunningStack) -> None:
    from mcp import Client, StdioServerParameters  # 2 s, in each worker that collects this file

    server = StdioServerParameters(
        command=sys.executable,
        args=[str(EXAMPLES / "mcp_server.py"), robot.endpoint],
        env={"PYTHONPATH": ENVIRONMENT["PYTHONPATH"]},
    )

    async def session() -> None:
        async with Client(server) as client:
            tools = {tool.name for tool in (await client.list_tools()).tools}
            assert tools == {"state", "sonars", "incidents", "drive", "stop"}
            stack.control.do(Sonar(name="rear", fault=True))
            wait_until(lambda: "fault" in robot.ultrasonic.latest().status, "the fault")
            sonars: Any = (await client.call_tool("sonars", {})).structured_content
            assert sonars["rear"] == "fault"
            before: Any = (await client.call_tool("state", {})).structured_content
            driven: Any = (await client.call_tool("drive", {"distance": 0.3})).structured_content
            way = math.dist((before["x"], before["y"]), (driven["x"], driven["y"]))
            assert way == pytest.approx(0.3, abs=0.1)
            await client.call_tool("stop", {})
            refused: Any = await client.call_tool("drive", {"turn": 90.0})
            assert refused.is_error
            assert "Emergency stop" in refused.content[0].text

    asyncio.run(asyncio.wait_for(session(), 100.0))
    stack.control.do(Sonar(name="rear"))
    wait_until(lambda: robot.safety.latest().latched == ("estop",), "the latch")


Pose = tuple[float, float, float]


def locates(robot: t2.Robot, program: str, lines: Iterator[str], pose: Pose) -> bool:
    """Return whether a localizer moves a vehicle that is placed beside this pose to it."""
    robot.localization.latest(PATIENCE_S)
    x, y, heading = pose
    robot.place(x + 0.3, y - 0.3, heading, sigma=0.5)
    words = [sys.executable, program, robot.endpoint]
    with subprocess.Popen(
        words, cwd=ROOT, env=ENVIRONMENT, stdin=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin is not None
        for line in lines:
            print(line, file=process.stdin, flush=True)
            time.sleep(0.1)
            now = robot.localization.latest()
            if (now.x, now.y, now.heading) == pytest.approx(pose, abs=0.06):
                break
        process.stdin.close()
        assert process.wait(PATIENCE_S) == 0
    now = robot.localization.latest()
    return (now.x, now.y, now.heading) == pytest.approx(pose, abs=0.06)


def test_plain_fixes_are_used(robot: t2.Robot) -> None:
    lines = repeat("1.1 2.1 0.55", 300)
    assert locates(robot, "examples/plain/fix.py", lines, (1.1, 2.1, 0.55))


def test_the_localizer_locates_the_vehicle_by_tags(robot: t2.Robot) -> None:
    tag = {"tag": "7", "x": 2.0, "y": 1.0, "heading": math.pi / 2, "age": 0.1}
    unknown = {"tag": "9", "x": 2.0, "y": 1.0, "heading": 0.0, "age": 0.1}
    lines = (json.dumps(unknown if step % 5 == 0 else tag) for step in range(300))
    # The tag at (4, 1) faces west; it is 2 m ahead and 1 m to the left of a vehicle facing north.
    assert locates(robot, "examples/localizer.py", lines, (5.0, -1.0, math.pi / 2))


def test_the_web_hook_gets_each_latch_once(robot: t2.Robot, stack: RunningStack) -> None:
    bodies: list[dict[str, object]] = []

    class Hook(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            bodies.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(204)
            self.end_headers()

    with HTTPServer(("127.0.0.1", 0), Hook) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        hook = f"http://127.0.0.1:{server.server_port}/hook"
        with example("examples/webhook.py", hook, robot.endpoint):
            for number in (1, 2):
                stack.control.do(Bumper(pressed=True))
                wait_until(lambda: len(bodies) >= number, "a POST")  # noqa: B023 - called here
                stack.control.do(Bumper(pressed=False))
                wait_until(lambda: not blocked(robot), "a reset")
        server.shutdown()
    assert [body["causes"] for body in bodies] == [["contact"], ["contact"]]


@pytest.mark.campaign
def test_the_wall_follower_approaches_the_wall(robot: t2.Robot) -> None:
    with example("examples/wall_follower.py", robot.endpoint):
        start = robot.odometry.latest()

        def follows() -> bool:
            pose, wall = robot.odometry.latest(5.0), robot.ultrasonic.latest(5.0).ranges[4]
            way = math.dist((start.x, start.y), (pose.x, pose.y))
            return way > 1.0 and wall is not None and 0.6 < wall < 1.0

        wait_until(follows, "the wall beside the vehicle", 100.0)


@pytest.mark.parametrize(
    ("range_m", "status", "distance"),
    [(1.5, "ok", 1.5), (None, "no_echo", math.inf), (None, "too_near", 0.0), (None, "fault", 0.0)],
)
def test_a_sonar_that_cannot_measure_counts_as_0(
    range_m: float | None, status: Any, distance: float
) -> None:
    """What a program that somebody copies does at 0.02 m, or with a faulty sonar."""
    clear: list[Any] = ["no_echo"] * 8
    ranges: list[float | None] = [None] * 8
    clear[2], ranges[2] = status, range_m
    sample: Any = Ultrasonic(ranges=tuple(ranges), status=tuple(clear))
    assert limit_speed.front(sample) == distance
    assert wall_follower.distance(sample, wall_follower.FRONT) == distance
    assert nearest_obstacle.nearest(sample) == distance
