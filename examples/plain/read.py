"""Print the pose and the nearest obstacle, twice a second."""

import math
import signal
import time

from robot_bus import Newest, open_session

signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends it without a traceback


def nearest(sonars):
    """Return the distance to the nearest obstacle; a sonar that cannot measure counts as 0."""
    measured = zip(sonars["ranges"], sonars["status"], strict=True)
    return min(r if s == "ok" else math.inf if s == "no_echo" else 0.0 for r, s in measured)


with open_session() as session:
    odometry = Newest(session, "tel/odom/odometry")
    ultrasonic = Newest(session, "tel/bridge/ultrasonic")
    while True:
        time.sleep(0.5)
        pose, sonars = odometry.take(), ultrasonic.take()
        if pose is None or sonars is None:
            print("no data for 0.5 s", flush=True)
            continue
        print(
            f"x {pose['x']:.2f} m  y {pose['y']:.2f} m"
            f"  heading {pose['heading']:.2f} rad  nearest {nearest(sonars):.2f} m",
            flush=True,
        )
