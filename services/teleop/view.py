"""The state on the screen as one frozen value: made in the loop's thread, drawn in another."""

from dataclasses import dataclass
from typing import Generic, TypeVar

from common.bus.bus import Arrival, Bus
from common.freshness import Latest, fresh
from common.keys import Topic
from common.messages import (
    Bumper,
    Direction,
    Driver,
    Level,
    Link,
    Message,
    Odometry,
    SafetyState,
    Ultrasonic,
    Velocity,
)
from common.motion import Twist

M = TypeVar("M", bound=Message)


class LatestTopic(Generic[M]):
    """The newest message of a topic, until it is too old to show."""

    def __init__(self, bus: Bus, topic: Topic[M], max_age_s: float, side: str = "") -> None:
        self._latest: Latest[M] | None = None
        self._max_age_s = max_age_s
        bus.subscribe(topic, self._on_message, side=side)

    def at(self, now_ns: int) -> M | None:
        """Return the message, or None once it is too old."""
        latest = self._latest
        return latest.value if latest and fresh(latest, now_ns, self._max_age_s) else None

    def _on_message(self, arrival: Arrival[M]) -> None:
        self._latest = Latest(arrival.message, arrival.received_ns)


@dataclass(frozen=True, slots=True)
class Line:
    """One line of the events panel."""

    t_ns: int  # wall clock
    service: str
    level: Level
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """Everything on the screen; None for values without a fresh message."""

    robot: str
    source: str
    connected: bool  # to a router
    alarm: str = ""  # what the operator must know first
    gear: int
    turbo: bool
    top: Twist  # of full deflection in this gear
    requested: Twist | None = None  # None: silent
    release: Direction | None = None  # direction of the release that the operator holds
    keys_refused: str = ""  # why keys are refused
    gamepad: str = ""  # its status
    move_stick: bool = False  # the gamepad drives and sent no event for a while
    safety: SafetyState | None = None
    velocity: Velocity | None = None
    odometry: Odometry | None = None
    ultrasonic: Ultrasonic | None = None
    bumper: Bumper | None = None
    link: Link | None = None
    left: Driver | None = None
    right: Driver | None = None
    lines: tuple[Line, ...] = ()  # the newest last
