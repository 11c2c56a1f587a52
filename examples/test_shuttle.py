"""Drive a simulated vehicle with your program, and check what it did."""

import subprocess
import sys

from t2.pytest_plugin import robot_fixture

robot = robot_fixture("empty", configs=["robot.toml"])  # ready to drive


def shuttle(robot):
    """Run the program; return its exit code and its error text."""
    words = [sys.executable, "plain/drive.py", robot.endpoint]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    return done.returncode, done.stderr


def test_it_drives_forward(robot):
    """The program drives, and ends without an error."""
    before = robot.odometry.latest().x
    assert shuttle(robot) == (0, "")
    assert robot.odometry.latest().x > before + 0.2


def test_it_reports_a_bumper_hit(robot):
    """The program ends with the cause of the stop."""
    robot.simulator.press_bumper()
    for state in robot.safety:
        if "contact" in state.latched:
            break
    code, text = shuttle(robot)
    assert code == 1
    assert "bumper" in text
