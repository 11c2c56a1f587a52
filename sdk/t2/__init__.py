"""Client library for robots that run T2: read, drive, limit, stop and reset.

``connect`` returns a ``Robot``. Units are SI and radians; frames follow REP-103 (x forward, y left,
counter-clockwise positive).
"""

from t2.aio import AsyncDrive as AsyncDrive
from t2.aio import AsyncRobot as AsyncRobot
from t2.aio import AsyncStream as AsyncStream
from t2.aio import aconnect as aconnect
from t2.connection import connect as connect
from t2.drive import Drive as Drive
from t2.errors import Blocked as Blocked
from t2.errors import Latched as Latched
from t2.errors import LinkError as LinkError
from t2.errors import NoData as NoData
from t2.errors import NotAllowed as NotAllowed
from t2.errors import NotConfirmed as NotConfirmed
from t2.errors import Overruled as Overruled
from t2.errors import Refused as Refused
from t2.errors import Stopped as Stopped
from t2.errors import T2Error as T2Error
from t2.limit import SpeedLimit as SpeedLimit
from t2.robot import Robot as Robot
from t2.sim import sim as sim
from t2.stream import Stream as Stream
