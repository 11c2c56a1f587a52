"""The examples as documented, with a real router and a fake robot."""

import math
import signal
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest

from common import keys
from common.bus.bus import Arrival, Bus
from common.loop import Loop
from common.messages import Limit, Odometry, Ultrasonic
from examples import limit_speed, nearest_obstacle
from verification.harness.bus import bus_on, router_process, running
from verification.harness.ports import free_port
from verification.harness.waiting import PATIENCE_S, wait_until

LIMITS: list[Limit] = []
RANGES = (2.0, 1.5, 0.62, None, 3.0, None, None, 4.0)


@pytest.fixture(scope="module")
def robot() -> Iterator[str]:
    """Run a router with a fake robot; yield the endpoint."""
    where = f"tcp/127.0.0.1:{free_port()}"

    def declare(bus: Bus) -> None:
        ultrasonic, odometry = bus.publisher(keys.ULTRASONIC), bus.publisher(keys.ODOMETRY)

        def publish(_: int) -> None:
            status = tuple("no_echo" if one is None else "ok" for one in RANGES)
            ultrasonic.put(Ultrasonic(ranges=RANGES, status=status))  # type: ignore[arg-type]
            odometry.put(
                Odometry(
                    x=1.25, y=-0.5, heading=0.1, linear=0.3, angular=0.0,
                    pose_covariance=(0.0,) * 9, twist_covariance=(0.0,) * 4,
                    epoch=0, residual=None, slip=False,
                )
            )  # fmt: skip

        loop.every(0.05, publish)
        bus.subscribe(keys.LIMIT, lambda it: LIMITS.append(it.message), source="lidar")

    with router_process(where), running(Loop()) as loop, bus_on(where, loop, declare):
        yield where


def first_line(*words: str) -> tuple[str, int]:
    """Run a program until its first line of output, then stop it like Ctrl-C."""
    with subprocess.Popen([sys.executable, *words], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=PATIENCE_S)
        finally:
            process.kill()
    return line, process.returncode


def test_the_consumer_with_t2_prints_the_nearest_obstacle(robot: str) -> None:
    line, code = first_line("-m", "examples.nearest_obstacle", "--set", f"bus.connect={robot}")
    assert line == "0.62 m front\n"
    assert code == 0


def test_the_plain_consumer_prints_the_pose(robot: str) -> None:
    line, _ = first_line("examples/watch_plain.py", robot)
    assert line == "x   1.25 m  y  -0.50 m   0.30 m/s\n"


def test_a_limit_slows_before_the_nearest_obstacle(robot: str) -> None:
    words = [sys.executable, "-m", "examples.limit_speed", "--set", f"bus.connect={robot}"]
    with subprocess.Popen(words) as process:
        try:
            wait_until(lambda: LIMITS, "a limit")
        finally:
            process.kill()
    limit = LIMITS[-1]
    assert (limit.linear, limit.angular, limit.reason) == (0.2, None, "something at 0.62 m")


@pytest.mark.parametrize(
    ("range_m", "status", "distance"),
    [(1.5, "ok", 1.5), (None, "no_echo", math.inf), (None, "too_near", 0.0), (None, "fault", 0.0)],
)
def test_a_front_sonar_that_cannot_measure_counts_as_0(
    range_m: float | None, status: Any, distance: float
) -> None:
    clear: list[Any] = ["no_echo"] * 8
    clear[2] = status
    ranges: list[float | None] = [None] * 8
    ranges[2] = range_m
    sample = Ultrasonic(ranges=tuple(ranges), status=tuple(clear))
    assert limit_speed.front(sample) == distance


def test_the_consumer_with_t2_counts_a_fault_as_0(capsys: pytest.CaptureFixture[str]) -> None:
    status: Any = ("ok", "ok", "ok", "fault", "ok", "no_echo", "too_near", "ok")
    sample = Ultrasonic(ranges=RANGES, status=status)
    nearest_obstacle.print_nearest(Arrival(sample, "", 0, b""))
    assert capsys.readouterr().out == "0.00 m front_right\n"
