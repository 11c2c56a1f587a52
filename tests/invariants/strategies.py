"""Value strategies of the state machine: few values, dense around thresholds."""

import math

from hypothesis import strategies as st

from common import messages as m
from common.motion import Command
from verification.invariants.net import CLEAR, Disturbance
from verification.invariants.vehicle import NO_ECHO_MM

BUS = st.sampled_from(["drive", "limit", "estop_keepalive", "motion", "state", "streams"])
CABLE = st.sampled_from(["to_board", "from_board"])
ON_BUS = st.sampled_from(
    [CLEAR, Disturbance(late_ms=30), Disturbance(late_ms=120), Disturbance(lose=2),
     Disturbance(lose=3), Disturbance(double=2), Disturbance(hold=3),
     Disturbance(late_ms=20, lose=5, double=3, hold=4), Disturbance(lose=1)]
)  # fmt: skip
ON_CABLE = st.sampled_from(
    [
        CLEAR,
        Disturbance(late_ms=20),
        Disturbance(lose=2),
        Disturbance(lose=3),
        Disturbance(double=2),
    ]
)  # fmt: skip
SPEEDS = st.sampled_from([0.0, 0.3, 1.0, -0.5, 5.0])
FAST = st.sampled_from([1.0, 0.6, -1.0])
TURNS = st.sampled_from([0.0, 0.0, 0.4, -1.0, 9.0])
CAPS = st.sampled_from([None, 0.0, 0.1, 0.3, 0.6, 5.0])
LIMITERS = st.sampled_from(["lidar", "fleet"])
SOURCES = st.sampled_from(["teleop", "nav"])
DIRECTIONS: st.SearchStrategy[m.Direction] = st.sampled_from(["backward", "forward"])
KINDS = st.sampled_from(["estop", "bumper", "driver", "runaway", "router"])
HASTY = st.sampled_from([5, 90, 320, 700, 1000])
PROCESSES = st.sampled_from(["safety", "bridge"])
SHORT = st.sampled_from([5, 20, 60, 150, 210, 320])
LONG = st.sampled_from([400, 700, 1200])
RANGES_MM = st.sampled_from([NO_ECHO_MM, 0xFFFF, 0, 120, 190, 210, 260, 400, 800, 1500])
NEAR_MM = st.sampled_from([0xFFFF, 190, 210, 260, 400, 800])
HOSTILE = {
    "nan": m.Drive(linear=math.nan, angular=0.0, echo=0),
    "infinite": m.Drive(linear=math.inf, angular=0.0, echo=0),
    "unknown echo": m.Drive(linear=0.5, angular=0.0, echo=-7),
    "old echo": m.Drive(linear=0.5, angular=0.0, echo=-12),
    "again": m.Drive(linear=0.5, angular=0.0, echo=0),
    "rival": m.Drive(linear=0.5, angular=0.0, echo=0, boot=5),
    "rival zero": m.Drive(linear=0.0, angular=0.0, echo=0, boot=6),
}
HOSTILE_LIMITS = {
    "nan": m.Limit(linear=math.nan, echo=0),
    "infinite": m.Limit(angular=math.inf, echo=0),
    "unknown echo": m.Limit(echo=-7),
    "old echo": m.Limit(echo=-12),
    "rival": m.Limit(linear=9.0, echo=0, boot=5),
    "rival stop": m.Limit(linear=0.0, echo=0, boot=6),
}
FORGED = [
    [m.Motion(command=Command.STOP, boot=666), m.Motion(command=Command.RUN, linear=0.7, boot=666)],
    [m.Motion(command=Command.RUN, linear=math.nan, boot=666)],
]
