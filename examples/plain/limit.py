"""Limit the speed to 0.1 m/s as the source "detector" while something is near in front."""

import math
import signal
import time

from robot_bus import Newest, Source, open_session

signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends it without a traceback

NEAR = 1.5  # m


def front(sonars):
    """Return the distance to the nearest obstacle; a sonar that cannot measure counts as 0."""
    measured = zip(sonars["ranges"][1:4], sonars["status"][1:4], strict=True)
    return min(r if s == "ok" else math.inf if s == "no_echo" else 0.0 for r, s in measured)


with open_session() as session:
    ultrasonic = Newest(session, "tel/bridge/ultrasonic")
    detector = Source(session, "limit", "detector")
    while True:
        time.sleep(0.1)  # 10 Hz, several times within the lease
        sonars = ultrasonic.take()
        if sonars is None:
            continue  # no data, no limit: safety then applies `silence`
        nearest = front(sonars)
        if nearest < NEAR:
            detector.put(linear=0.1, reason=f"obstacle at {nearest:.1f} m")  # m/s
        else:
            detector.put(linear=None)  # no cap
