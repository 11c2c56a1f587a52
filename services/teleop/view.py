"""What the screen shows: made in the loop's thread, drawn in another, in any language."""

from dataclasses import dataclass

from common.motion import Twist
from common.root_cause import Part
from services.teleop.event_log import Line
from t2.messages import (
    Bumper,
    Drive,
    Driver,
    Link,
    MapPose,
    Odometry,
    Phrase,
    Phrases,
    SafetyState,
    Ultrasonic,
    Velocity,
)

# Without one of these no command reaches the wheels, and a board may keep its last one.
BELOW_SAFETY: tuple[Part, ...] = ("bridge", "relay", "board")


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """Everything on the screen; None for values without a fresh message."""

    robot: str
    source: str
    connected: bool  # to a router
    router: str = ""  # its endpoints
    doctor: str = "`t2 doctor`"  # with the options of this program
    may_drive: bool = True
    may_stop: bool = True
    alarm: Phrases = ()  # what the operator must know first
    gear: int
    top: Twist  # of full deflection in this gear
    requested: Drive | None = None  # None: silent
    keyboard_refused: Phrases = ()  # why keystrokes are refused
    keystroke_notice: Phrases = ()  # of one without a function
    keyboard_muted: bool = False  # until it was let go
    gamepad: Phrase  # its status
    gamepad_notice: Phrases = ()  # what the operator must do with it
    safety: SafetyState | None = None
    velocity: Velocity | None = None
    odometry: Odometry | None = None
    map_pose: MapPose | None = None
    ultrasonic: Ultrasonic | None = None
    bumper: Bumper | None = None
    link: Link | None = None
    left: Driver | None = None
    right: Driver | None = None
    lines: tuple[Line, ...] = ()  # the newest last
