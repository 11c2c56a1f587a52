"""Write the vehicle's pose to a CSV file, until Ctrl-C.

python odometry_logger.py poses.csv [tcp/127.0.0.1:7447]
"""

import csv
import sys
from pathlib import Path

import t2

FIELDS = ("t_ns", "x", "y", "heading", "linear", "angular")  # ns, m, m, rad, m/s, rad/s


def log(file: Path, endpoint: str) -> None:
    """Append a row for each message; odometry sends up to 25 a second."""
    with file.open("w", newline="") as out, t2.connect("001", endpoint=endpoint) as robot:
        rows = csv.writer(out)
        rows.writerow(FIELDS)
        robot.odometry.latest(timeout=5)  # raises t2.NoData
        for pose in robot.odometry:
            rows.writerow([getattr(pose, field) for field in FIELDS])
            out.flush()


if __name__ == "__main__":
    try:
        log(Path(sys.argv[1]), "".join(sys.argv[2:]))
    except KeyboardInterrupt:
        pass
    except t2.T2Error as error:
        sys.exit(str(error))
