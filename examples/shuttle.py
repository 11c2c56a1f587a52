"""Drive 0.4 m forward, turn left and turn back, as the source "shuttle".

python shuttle.py [tcp/127.0.0.1:7447], with [safety.sources] shuttle in safety's settings
"""

import math
import sys

import t2


def shuttle(endpoint: str) -> None:
    """Drive; raises ``t2.Latched``, ``t2.Blocked``, ``t2.Overruled``, ``t2.NotAllowed``, ..."""
    with t2.connect("001", endpoint=endpoint) as robot, robot.drive("shuttle") as drive:
        drive.forward(0.4, on_stop="wait")
        drive.turn(math.pi / 2, on_stop="wait")
        drive.turn(-math.pi / 2, on_stop="wait")


if __name__ == "__main__":
    try:
        shuttle("".join(sys.argv[1:]))
    except t2.T2Error as error:
        sys.exit(f"{type(error).__name__}: {error}")
