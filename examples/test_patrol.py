"""Drive the simulated vehicle, and check what it did."""

import json
import os
import signal
import socket
import subprocess
import sys
import time

import pytest

import t2

ROUTER = os.environ.get("ROUTER", "tcp/127.0.0.1:7447")
CONTROL = int(os.environ.get("T2__SIM__CONTROL_PORT", "4090"))  # sim.control_port


def wait_until(true, what):
    """Wait until a condition holds, for a minute at most."""
    end = time.monotonic() + 60.0
    while not true():
        assert time.monotonic() < end, what
        time.sleep(0.1)


@pytest.fixture(scope="session")
def robot():
    """Run the stack with the settings of ``robot.toml``, and connect to its robot."""
    stack = subprocess.Popen(["t2", "up", "--config", "robot.toml", "--world", "empty"])
    try:
        wait_until(may_drive, "safety permits driving")
        with t2.connect("001", endpoint=ROUTER) as it:
            yield it
    finally:
        stack.send_signal(signal.SIGINT)
        stack.wait(timeout=30)


def may_drive():
    """Return whether nothing but a missing request stops the vehicle."""
    try:
        with t2.connect("001", endpoint=ROUTER) as robot:
            causes = robot.safety.latest(timeout=5.0).causes
    except (t2.LinkError, t2.NoData):  # not yet
        return False
    return {cause.name for cause in causes} <= {"no_request", "neutral"}


def simulate(**request):
    """Send a request to the simulated vehicle: sim/requests.py of T2 lists them."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.sendto(json.dumps(request).encode(), ("127.0.0.1", CONTROL))


def patrol():
    """Run the program; return its exit code and its error text."""
    words = [sys.executable, "plain/drive.py", ROUTER]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    return done.returncode, done.stderr


def test_it_drives_forward(robot):
    """The program drives, and ends without an error."""
    before = robot.odometry.latest().x
    assert patrol() == (0, "")
    assert robot.odometry.latest().x > before + 0.2


def test_it_reports_a_bumper_hit(robot):
    """The program ends with the cause of the stop."""
    simulate(do="bumper", pressed=True)
    wait_until(lambda: "contact" in robot.safety.latest().latched, "the hit latches")
    code, text = patrol()
    assert code == 1
    assert "bumper" in text
    simulate(do="bumper", pressed=False)
