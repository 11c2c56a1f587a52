"""Drive forward at 0.2 m/s for 2 s as the source "shuttle"."""

import sys
import time

from robot_bus import Source, open_session

NAME = "shuttle"  # one of safety.sources
PERIOD = 0.05  # s: 20 Hz


def drive(shuttle):
    """Return why it ended early; None otherwise."""
    if not take_control(shuttle):
        why = reason(shuttle.state) or "safety.sources or your certificate does not name it"
        return f"safety does not obey {NAME}: {why}"
    end = time.monotonic() + 2.0
    while time.monotonic() < end:
        shuttle.put(linear=0.2, angular=0.0)  # m/s, rad/s
        time.sleep(PERIOD)
        if stopped := reason(shuttle.state):
            return stopped
    return None


def take_control(shuttle):
    """Put neutral requests until safety would let this source drive, for 2 s at most."""
    for tick in range(40):
        shuttle.put(linear=0.0, angular=0.0)
        time.sleep(PERIOD)
        in_control = shuttle.state and shuttle.state["source"] == NAME
        if tick > 10 and in_control and not reason(shuttle.state):
            return True
    return False


def reason(state):
    """Return why safety does not move the vehicle for this source; empty if it does."""
    if state is None:
        return "safety is silent"
    for cause in state["causes"]:  # the worst first
        if cause["action"] != "slow" and cause["name"] != "no_request":
            return cause["text"]
    if state["source"] not in (NAME, None):
        return f"{state['source']} drives"
    return ""


with open_session() as session:
    source = Source(session, "drive", NAME)
    try:
        failure = drive(source)
    finally:
        for _ in range(3):  # one may be lost
            source.put(linear=0.0, angular=0.0)
            time.sleep(PERIOD)
sys.exit(failure)
