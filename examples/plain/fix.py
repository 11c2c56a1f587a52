"""Send a fix of the position for each line "x y heading" of standard input, as the source "tags".

In metres and radians in the map, without a heading if it is not measured. Each line is read when
the position is measured.
"""

import sys
import time

import msgpack
from robot_bus import ROOT, Newest, open_session

SIGMA = 0.05  # m and rad, standard deviation

with open_session() as session:
    odometry = Newest(session, "tel/odom/odometry")
    while (newest := odometry.take()) is None:
        time.sleep(0.02)
    for line in sys.stdin:
        newest = odometry.take() or newest
        x, y, *heading = map(float, line.split())
        fix = {
            "x": x,
            "y": y,
            "heading": heading[0] if heading else None,
            "covariance": [SIGMA**2, 0, 0, 0, SIGMA**2, 0, 0, 0, SIGMA**2],  # x, y, heading
            "odom_boot": newest["boot"],
            "odom_seq": newest["seq"],
        }
        session.put(f"{ROOT}/@cmd/fix/tags", msgpack.packb(fix))
