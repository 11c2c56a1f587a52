"""An example of every frame of the wire."""

from common.wire import commands as c
from common.wire import reports as r
from common.wire.frame import Frame, Side

# One of each, with non-zero bytes where possible.
COMMANDS: tuple[Frame, ...] = (
    c.MotionCommand(c.MotionKind.RUN, 500, -300),
    c.DistanceQuery(),
    c.UltrasonicQuery(),
    c.BumperQuery(),
    c.UltrasonicBrakeSet(True),
    c.BumperBrakeSet(True),
    c.DriverQuery(Side.RIGHT),
    c.LedSet(9, 1, 8, 2, 3, 4, 5, 6, 7),
)
REPORTS: tuple[Frame, ...] = (
    r.VelocityReport(-1000, 250),
    r.DistanceReport(-123456, 1799),
    r.UltrasonicReport((100, 200, 300, 400, 500, 600, 0xFFFF, 5000)),
    r.BumperReport(True),
    r.UltrasonicBrakeReport(True),
    r.BumperBrakeReport(True),
    r.DriverReport(Side.LEFT, 0x8000001F),
    r.LedReport(True),
)
