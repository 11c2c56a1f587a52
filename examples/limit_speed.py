"""Limit the speed to 0.1 m/s as the source "detector" while something is near in front.

python limit_speed.py [tcp/127.0.0.1:7447], with [safety.limits.detector] in safety's settings
"""

import math
import signal
import sys
import time

import t2

NEAR = 1.5  # m
LEASE = 0.5  # s, as in the settings


def front(sonars: t2.messages.Ultrasonic) -> float:
    """Return the distance to the nearest obstacle; a sonar that cannot measure counts as 0."""
    measured = zip(sonars.ranges[1:4], sonars.status[1:4], strict=True)
    return min({"ok": r or 0.0, "no_echo": math.inf}.get(s, 0.0) for r, s in measured)


def main(endpoint: str) -> None:
    """Publish a limit 10 times a second; ends when the sonars are silent: ``t2.NoData``."""
    with t2.connect("001", endpoint=endpoint) as robot:
        while True:
            near = front(robot.ultrasonic.latest(timeout=0.5))
            cap = 0.1 if near < NEAR else None  # m/s
            reason = f"obstacle at {near:.1f} m" if near < NEAR else ""
            robot.limit("detector", linear=cap, reason=reason, seconds=LEASE)
            time.sleep(0.1)


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends it without a traceback
    main("".join(sys.argv[1:]))
