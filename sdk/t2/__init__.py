"""Client library for robots that run T2: read, drive, limit, stop and reset.

``connect`` returns a ``Robot``. Units are SI and radians; frames follow REP-103 (x forward, y left,
counter-clockwise positive). ``t2.messages`` has the types of the messages.

The modules ``messages``, ``keys``, ``codec`` and ``client`` are the contract of the bus, which the
stack uses, too. So the names below are imported on first use, and a service that needs a message
imports neither Zenoh nor threads.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from t2 import messages as messages

if TYPE_CHECKING:
    from t2.aio import AsyncDrive as AsyncDrive
    from t2.aio import AsyncPatrol as AsyncPatrol
    from t2.aio import AsyncRobot as AsyncRobot
    from t2.aio import AsyncStream as AsyncStream
    from t2.aio import aconnect as aconnect
    from t2.connection import connect as connect
    from t2.connection import robots as robots
    from t2.drive import Drive as Drive
    from t2.errors import Blocked as Blocked
    from t2.errors import Incompatible as Incompatible
    from t2.errors import Latched as Latched
    from t2.errors import Late as Late
    from t2.errors import LinkError as LinkError
    from t2.errors import Lost as Lost
    from t2.errors import NoData as NoData
    from t2.errors import NotAllowed as NotAllowed
    from t2.errors import NotConfirmed as NotConfirmed
    from t2.errors import Overruled as Overruled
    from t2.errors import PoseSet as PoseSet
    from t2.errors import Refused as Refused
    from t2.errors import Stopped as Stopped
    from t2.errors import T2Error as T2Error
    from t2.patrol import Patrol as Patrol
    from t2.recording import Recording as Recording
    from t2.robot import Robot as Robot
    from t2.simulator import SimulatedRobot as SimulatedRobot
    from t2.simulator import Simulator as Simulator
    from t2.simulator import sim as sim
    from t2.stream import Stream as Stream
    from t2.stream import Subscription as Subscription
    from t2.third_party import Keepalive as Keepalive
    from t2.third_party import SpeedLimit as SpeedLimit

__version__: str = messages.VERSION

# By module: what it exports here.
_EXPORTS = {
    "aio": ("AsyncDrive", "AsyncPatrol", "AsyncRobot", "AsyncStream", "aconnect"),
    "connection": ("connect", "robots"),
    "drive": ("Drive",),
    "errors": (
        "Blocked", "Incompatible", "Latched", "Late", "LinkError", "Lost", "NoData",
        "NotAllowed", "NotConfirmed", "Overruled", "PoseSet", "Refused", "Stopped", "T2Error",
    ),
    "patrol": ("Patrol",),
    "recording": ("Recording",),
    "robot": ("Robot",),
    "simulator": ("SimulatedRobot", "Simulator", "sim"),
    "stream": ("Stream", "Subscription"),
    "third_party": ("Keepalive", "SpeedLimit"),
}  # fmt: skip
_HOME = {name: module for module, names in _EXPORTS.items() for name in names}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 't2' has no attribute {name!r}")
    value: object = getattr(import_module(f"t2.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__", "messages"]
