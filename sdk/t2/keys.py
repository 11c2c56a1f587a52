"""Table of all keys on the bus: message type, rate, class of service.

Keys have the form ``t2/v1/{robot}/{class}/...``. ``@cmd`` is a verbatim chunk on purpose: a
``put t2/**`` made by mistake does not match it. ``estop`` is none on purpose: ``put t2/v1/*/estop``
stops a fleet.
"""

from collections.abc import Iterable
from typing import Any, Generic, Literal, TypeVar

import msgspec
from msgspec import Struct

from t2 import messages as m

ROOT = "t2/v1"

SERVICES = (
    "bridge", "safety", "odom", "localization", "patrol", "camera", "teleop", "dashboard",
    "recorder", "metrics", "ros2",
)  # fmt: skip

MessageT = TypeVar("MessageT", bound=m.Message)
RequestT = TypeVar("RequestT", bound=Struct)
ReplyT = TypeVar("ReplyT", bound=Struct)

Priority = Literal[
    "REAL_TIME", "INTERACTIVE_HIGH", "INTERACTIVE_LOW", "DATA_HIGH", "DATA", "BACKGROUND"
]


class ClassOfService(Struct, frozen=True):
    """How Zenoh carries a key; congestion always drops, because blocking stalls other links."""

    name: str
    priority: Priority
    reason: str
    express: bool = False  # sent immediately, never batched
    history: int = 0  # samples kept for late and recovering subscribers
    # For other sessions only: otherwise a subscriber of the same session matches, also while the
    # router drops the messages.
    remote: bool = False


ESTOP_CLASS = ClassOfService("estop", "REAL_TIME", "has the highest priority", express=True)
COMMAND = ClassOfService(
    "command", "INTERACTIVE_HIGH", "moves or stops the wheels", express=True, remote=True
)
STATE = ClassOfService(
    "state", "INTERACTIVE_LOW", "sources echo it: a late one stops the vehicle", express=True
)
FAST = ClassOfService("fast", "DATA_HIGH", "safety and odometry decide on it")
SLOW = ClassOfService("slow", "DATA", "for people and recordings")
BULK = ClassOfService("bulk", "BACKGROUND", "large: waits for everything else")
EVENT = ClassOfService("event", "DATA", "rare, and useful even when late", history=100)
EVENTS_DEPTH = EVENT.history * (len(SERVICES) + 2)  # a queue for the history of all, at once


class Topic(Struct, Generic[MessageT], frozen=True):
    """A published key; ``on`` fills in the ``{name}`` in its path."""

    path: str
    message: type[MessageT]
    rate_hz: float  # by default; 0 for events
    service: ClassOfService
    publisher: str
    what: str

    def on(self, robot: str, **names: str) -> str:
        """Return the full key for one robot, or a key expression for ``*``."""
        return f"{ROOT}/{robot}/{self.path.format(**names)}"


class Call(Struct, Generic[RequestT, ReplyT], frozen=True):
    """A key that answers queries: one request, one reply or a refusal with its reason."""

    path: str
    request: type[RequestT]
    reply: type[ReplyT]
    server: str
    what: str
    priority: Priority = "DATA"

    def on(self, robot: str) -> str:
        """Return the full key for one robot."""
        return f"{ROOT}/{robot}/{self.path}"


VELOCITY = Topic(
    "tel/bridge/velocity",
    m.Velocity,
    50,
    FAST,
    "bridge",
    "measured velocity, as the board sends it",
)
MILEAGE = Topic(
    "tel/bridge/mileage", m.Mileage, 25, FAST, "bridge", "the board's own distance and heading"
)
ULTRASONIC = Topic("tel/bridge/ultrasonic", m.Ultrasonic, 20, FAST, "bridge", "eight ranges")
BUMPER = Topic("tel/bridge/bumper", m.Bumper, 50, FAST, "bridge", "the bumper strip")
DRIVER = Topic(
    "tel/bridge/driver/{side}", m.Driver, 2, SLOW, "bridge", "faults of the left or right driver"
)
SWITCHES = Topic(
    "tel/bridge/switches", m.Switches, 1, SLOW, "bridge", "the board's own emergency brakes"
)
LINK = Topic("tel/bridge/link", m.Link, 5, FAST, "bridge", "the link to the board")
ODOMETRY = Topic("tel/odom/odometry", m.Odometry, 25, FAST, "odom", "pose and twist")
MAP_POSE = Topic(
    "tel/localization/pose", m.MapPose, 25, FAST, "localization", "pose in the map, and its fixes"
)
PATROL = Topic(
    "tel/patrol/state", m.PatrolState, 5, SLOW, "patrol", "the round, its progress, the next one"
)
PICTURE = Topic(
    "tel/camera/{camera}/picture",
    m.Picture,
    15,
    BULK,
    "camera",
    "pictures, each with the newest heartbeat of safety when it was taken",
)
CAMERA = Topic(
    "tel/camera/{camera}/state", m.Camera, 1, SLOW, "camera", "whether a camera has pictures"
)
SAFETY = Topic(
    "tel/safety/state",
    m.SafetyState,
    20,
    STATE,
    "safety",
    "verdict, causes, and the driving source",
)
HEALTH = Topic("tel/{service}/health", m.Health, 1, SLOW, "every service", "health of a service")
SETTINGS = Topic(
    "tel/{service}/settings",
    m.Settings,
    0.1,
    SLOW,
    "every service",
    "effective settings, 1.9 kB of the bridge, 3.1 kB of safety; the first when a reader appears",
)
EVENTS = Topic("evt/{service}", m.Event, 0, EVENT, "every service", "transitions")
DRIVE = Topic(
    "@cmd/drive/{source}", m.Drive, 20, COMMAND, "teleop, web, nav, ...", "a request to move"
)
LIMIT = Topic(
    "@cmd/limit/{source}",
    m.Limit,
    10,
    COMMAND,
    "a lidar, a fleet manager, a pendant, ...",
    "a speed limit, a protective stop, or a sign of life of an emergency stop",
)
FIX = Topic(
    "@cmd/fix/{source}", m.Fix, 10, FAST, "tags, gnss, amcl, ...", "a measured pose in the map"
)
MOTION = Topic("@cmd/motion", m.Motion, 50, COMMAND, "safety", "the motion that safety allows")

# The services that make a robot, in the order of a request: others run on laptops, too, under the
# name of any robot.
ON_BOARD = ("safety", "bridge", "odom")

# Any PUT or DELETE on it, with any payload or none, stops the robot and latches.
ESTOP_PATH = "estop"

SET_SWITCHES = Call(
    "srv/bridge/switches", m.SwitchesRequest, m.Switches, "bridge", "set the emergency brakes"
)
SET_LED = Call("srv/bridge/led", m.LedRequest, m.Done, "bridge", "set one lamp channel")
RESET = Call("srv/safety/reset", m.ResetRequest, m.ResetDone, "safety", "clear the named causes")
SET_POSE = Call("srv/odom/reset", m.PoseRequest, m.Done, "odom", "start odometry at a pose")
PLACE = Call(
    "srv/localization/place", m.PlaceRequest, m.Done, "localization", "say where the vehicle is"
)
TEACH = Call("srv/patrol/teach", m.TeachRequest, m.Done, "patrol", "teach or change a route")
ROUTES = Call("srv/patrol/routes", m.RoutesRequest, m.RoutesReply, "patrol", "read the routes")
GET_PICTURE = Call(
    "srv/camera/picture", m.PictureRequest, m.Picture, "camera",
    "return the next picture, in a size that a slow link takes", "BACKGROUND",
)  # fmt: skip
ROUND = Call("srv/patrol/round", m.RoundRequest, m.Done, "patrol", "start, pause or end a round")
ROUNDS = Call("srv/patrol/rounds", m.RoundsRequest, m.RoundsReply, "patrol", "read the ledger")
LOG = Call("srv/recorder/log", m.LogRequest, m.LogReply, "recorder", "read the shift log")

TOPICS: tuple[Topic[m.Message], ...] = (
    VELOCITY, MILEAGE, ULTRASONIC, BUMPER, DRIVER, SWITCHES, LINK,
    ODOMETRY, MAP_POSE, PATROL, PICTURE, CAMERA, SAFETY, HEALTH, SETTINGS, EVENTS,
    DRIVE, LIMIT, FIX, MOTION,
)  # type: ignore[assignment]  # fmt: skip
CALLS: tuple[Call[Struct, Struct], ...] = (
    SET_SWITCHES, SET_LED, RESET, SET_POSE, PLACE, TEACH, ROUTES, ROUND, ROUNDS, GET_PICTURE,
    LOG,
)  # type: ignore[assignment]  # fmt: skip

READING_CALLS = (ROUTES, ROUNDS, GET_PICTURE, LOG)  # they change nothing


def estop_key(robot: str) -> str:
    """Return the key that stops one robot, or all for ``*``."""
    return f"{ROOT}/{robot}/{ESTOP_PATH}"


def info_key(robot: str, service: str, part: str) -> str:
    """Return the key of a service's ``schema``, ``config`` or ``last`` messages."""
    return f"{ROOT}/{robot}/info/{service}/{part}"


def app_key(robot: str, name: str) -> str:
    """Return the prefix of the keys that a member of the bus may use as it likes."""
    return f"{ROOT}/{robot}/app/{name}"


def live_key(robot: str, service: str, instance: str) -> str:
    """Return the liveliness token of one running service."""
    return f"{ROOT}/{robot}/live/{service}/{instance}"


def schemas(topics: Iterable[Topic[m.Message]]) -> dict[str, Any]:
    """Return the JSON schema of each topic's message, by the topic's path."""
    return {
        topic.path: msgspec.json.schema(topic.message)
        for topic in sorted(topics, key=lambda topic: topic.path)
    }
