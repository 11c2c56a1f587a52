"""Programs that fork: each process is a publisher of its own, and a connection stays behind."""

import subprocess
import sys

import msgspec
import pytest
import zenoh

import t2
from common.bus.session import client_config
from t2.messages import Drive
from verification.harness.bus import at
from verification.harness.stack import RunningStack

pytestmark = pytest.mark.timed

MISSIONS = """
import os, sys, t2

def mission():
    with t2.connect("001", endpoint=sys.argv[1]) as robot, robot.drive("nav") as drive:
        drive.turn(0.2)

for _ in range(2):
    child = os.fork()
    if not child:
        mission()
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0
"""
INHERITED = """
import os, signal, sys, t2

with t2.connect("001", endpoint=sys.argv[1]) as robot, robot.drive("nav") as drive:
    uses = {
        "connect": lambda: t2.connect("001", endpoint=sys.argv[1]),
        "velocity": lambda: drive.velocity(0.1), "drive": lambda: robot.drive("web"),
        "latest": robot.safety.latest, "led": lambda: robot.led(channel=1, mode=1),
        "estop": robot.estop, "reset": robot.reset, "close": robot.close,
        "limit": lambda: robot.limit("detector", seconds=1),
    }
    for name, use in uses.items():
        child = os.fork()
        if not child:
            signal.alarm(5)
            try:
                use()
            except t2.LinkError as error:
                os._exit(0 if "fork" in str(error) else 1)
            os._exit(2)
        print(name, os.waitpid(child, 0)[1], flush=True)
    drive.turn(0.1)
"""


def output(program: str, stack: RunningStack) -> str:
    """Run a program; return its output, and fail with it."""
    done = subprocess.run(
        [sys.executable, "-c", program, stack.endpoint],
        capture_output=True, text=True, timeout=90, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_each_process_is_a_publisher_of_its_own(robot: t2.Robot, stack: RunningStack) -> None:
    boots = set[int]()

    def note(sample: zenoh.Sample) -> None:
        boots.add(msgspec.msgpack.decode(sample.payload.to_bytes(), type=Drive).boot)

    with zenoh.open(client_config(at(stack.endpoint))) as session:
        session.declare_subscriber("t2/v1/001/@cmd/drive/nav", note)
        output(MISSIONS, stack)
    assert len(boots) == 2


def test_an_inherited_connection_raises(robot: t2.Robot, stack: RunningStack) -> None:
    results = dict(line.split() for line in output(INHERITED, stack).splitlines())
    assert len(results) == 9
    assert set(results.values()) == {"0"}, results
