"""Client library for robots that run T2: read, drive, limit, stop and reset.

``connect`` returns a ``Robot``. Units are SI and radians; frames follow REP-103 (x forward, y left,
counter-clockwise positive). ``t2.messages`` has the types of the messages.
"""

from t2 import messages as messages
from t2.aio import AsyncDrive, AsyncRobot, AsyncStream, aconnect
from t2.connection import connect, robots
from t2.drive import Drive
from t2.errors import (
    Blocked,
    Incompatible,
    Latched,
    Late,
    LinkError,
    NoData,
    NotAllowed,
    NotConfirmed,
    Overruled,
    PoseSet,
    Refused,
    Stopped,
    T2Error,
)
from t2.recording import Recording
from t2.robot import Robot
from t2.sim import SimulatedRobot, Simulator, sim
from t2.stream import Stream, Subscription
from t2.third_party import Keepalive, SpeedLimit

__version__: str = messages.VERSION
__all__ = [
    "AsyncDrive",
    "AsyncRobot",
    "AsyncStream",
    "Blocked",
    "Drive",
    "Incompatible",
    "Keepalive",
    "Latched",
    "Late",
    "LinkError",
    "NoData",
    "NotAllowed",
    "NotConfirmed",
    "Overruled",
    "PoseSet",
    "Recording",
    "Refused",
    "Robot",
    "SimulatedRobot",
    "Simulator",
    "SpeedLimit",
    "Stopped",
    "Stream",
    "Subscription",
    "T2Error",
    "aconnect",
    "connect",
    "robots",
    "sim",
]


def __dir__() -> list[str]:
    return [*__all__, "__version__", "messages"]
