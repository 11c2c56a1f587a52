"""Every key on the bus, in one table: what it carries, how often, in which class of service.

Keys read ``t2/v1/{robot}/{class}/...``. ``@cmd`` is a verbatim chunk on purpose: a ``put t2/**``
made by mistake does not reach it. ``estop`` is not, on purpose: ``put t2/v1/*/estop`` stops a
fleet.
"""

from collections.abc import Collection, Mapping
from typing import Generic, Literal, TypeVar

from msgspec import Struct

from common import messages as m

ROOT = "t2/v1"

# Known values of a ``{name}`` in a path; those of sources are in the settings.
SERVICES = ("bridge", "safety", "odom", "teleop", "dashboard", "recorder", "metrics")
KNOWN: Mapping[str, Collection[str]] = {"service": SERVICES, "side": ("left", "right")}

MessageT = TypeVar("MessageT", bound=m.Message)
RequestT = TypeVar("RequestT", bound=Struct)
ReplyT = TypeVar("ReplyT", bound=Struct)

Priority = Literal["REAL_TIME", "INTERACTIVE_HIGH", "INTERACTIVE_LOW", "DATA_HIGH", "DATA"]


class ClassOfService(Struct, frozen=True):
    """How Zenoh carries a key; congestion always drops, because blocking stalls the healthy."""

    name: str
    priority: Priority
    reason: str
    express: bool = False  # sent at once, never batched
    history: int = 0  # samples that late joiners and recovering readers still get


ESTOP_CLASS = ClassOfService("estop", "REAL_TIME", "nothing may be ahead of it", express=True)
COMMAND = ClassOfService("command", "INTERACTIVE_HIGH", "moves or stops the wheels", express=True)
STATE = ClassOfService(
    "state", "INTERACTIVE_LOW", "who drives echoes it: late, it stops the vehicle", express=True
)
FAST = ClassOfService("fast", "DATA_HIGH", "safety and odometry decide on it")
SLOW = ClassOfService("slow", "DATA", "people and records read it")
EVENT = ClassOfService("event", "DATA", "rare, and worth having late", history=100)


class Topic(Struct, Generic[MessageT], frozen=True):
    """A key that is published; ``{name}`` in its path is filled in by ``on``."""

    path: str
    message: type[MessageT]
    rate_hz: float  # as shipped; 0 for "when it happens"
    service: ClassOfService
    publisher: str
    what: str

    def on(self, robot: str, **names: str) -> str:
        """Return the whole key for one robot, or a key expression for ``*``."""
        return f"{ROOT}/{robot}/{self.path.format(**names)}"

    def known(self, robot: str, names: Mapping[str, str], known: Collection[str]) -> frozenset[str]:
        """Return the known keys in an expression: of ``known``, otherwise of ``KNOWN``."""
        return frozenset(
            self.on(robot, **{**names, name: each})
            for name in names
            if names[name] == "*"
            for each in known or KNOWN.get(name, ())
        )


class Call(Struct, Generic[RequestT, ReplyT], frozen=True):
    """A key that answers queries: one request, one reply or a refusal with its reason."""

    path: str
    request: type[RequestT]
    reply: type[ReplyT]
    server: str
    what: str

    def on(self, robot: str) -> str:
        """Return the whole key for one robot."""
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
    "tel/bridge/mileage", m.Mileage, 50, FAST, "bridge", "the board's own distance and heading"
)
ULTRASONIC = Topic("tel/bridge/ultrasonic", m.Ultrasonic, 20, FAST, "bridge", "eight ranges")
BUMPER = Topic("tel/bridge/bumper", m.Bumper, 50, FAST, "bridge", "the bumper strip")
DRIVER = Topic(
    "tel/bridge/driver/{side}", m.Driver, 2, SLOW, "bridge", "faults of the left or right driver"
)
SWITCHES = Topic(
    "tel/bridge/switches", m.Switches, 1, SLOW, "bridge", "the board's own emergency brakes"
)
LINK = Topic("tel/bridge/link", m.Link, 5, FAST, "bridge", "the way to the board")
ODOMETRY = Topic("tel/odom/odometry", m.Odometry, 50, FAST, "odom", "pose and twist")
SAFETY = Topic(
    "tel/safety/state", m.SafetyState, 20, STATE, "safety", "verdict, causes, and who drives"
)
HEALTH = Topic("tel/{service}/health", m.Health, 1, SLOW, "every service", "how a service fares")
EVENTS = Topic("evt/{service}", m.Event, 0, EVENT, "every service", "transitions")
DRIVE = Topic(
    "@cmd/drive/{source}", m.Drive, 20, COMMAND, "teleop, web, nav, ...", "a request to move"
)
MOTION = Topic("@cmd/motion", m.Motion, 50, COMMAND, "safety", "what safety lets through")

# Any PUT or DELETE on it, with any payload or none, stops the robot and latches.
ESTOP_PATH = "estop"

SET_SWITCHES = Call(
    "srv/bridge/switches", m.SwitchesRequest, m.Switches, "bridge", "set the emergency brakes"
)
SET_LED = Call("srv/bridge/led", m.LedRequest, m.Done, "bridge", "set one lamp channel")
RESET = Call(
    "srv/safety/reset", m.ResetRequest, m.ResetDone, "safety", "clear the causes that are named"
)
RELEASE = Call(
    "srv/safety/release", m.ReleaseRequest, m.Done, "safety", "creep off a pressed bumper, held"
)
SET_POSE = Call("srv/odom/reset", m.PoseRequest, m.Done, "odom", "start odometry at a pose")

TOPICS: tuple[Topic[m.Message], ...] = (
    VELOCITY, MILEAGE, ULTRASONIC, BUMPER, DRIVER, SWITCHES, LINK,
    ODOMETRY, SAFETY, HEALTH, EVENTS, DRIVE, MOTION,
)  # type: ignore[assignment]  # fmt: skip
CALLS: tuple[Call[Struct, Struct], ...] = (
    SET_SWITCHES, SET_LED, RESET, RELEASE, SET_POSE,
)  # type: ignore[assignment]  # fmt: skip


def estop_key(robot: str) -> str:
    """Return the key that stops one robot, or all for ``*``."""
    return f"{ROOT}/{robot}/{ESTOP_PATH}"


def info_key(robot: str, service: str, part: str) -> str:
    """Return where a service answers what a newcomer asks: ``schema``, ``config``, ``last``."""
    return f"{ROOT}/{robot}/info/{service}/{part}"


def live_key(robot: str, service: str, instance: str) -> str:
    """Return the liveliness token of one running service."""
    return f"{ROOT}/{robot}/live/{service}/{instance}"
