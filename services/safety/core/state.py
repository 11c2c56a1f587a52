"""State carried from one decision to the next, and the verdict of a decision."""

from msgspec import Struct

from common.heartbeat import Heartbeat
from common.motion import STILL, STOP, Twist
from services.safety.core.arbiter import Arbiter
from services.safety.core.causes import FaultBudget, Latches, Token
from services.safety.core.motion_watch import MotionWatch
from services.safety.core.release import Leg, Release
from services.safety.core.sonars import SonarArray, SonarOverrides
from services.safety.core.speed_limits import SpeedLimits
from t2.messages import Command, Phrases
from t2.messages import Verdict as VerdictName


class Reply(Struct, frozen=True):
    """Answer to a reset."""

    done: bool
    phrases: Phrases
    cleared: tuple[int, ...] = ()  # identities of the causes that a reset cleared


class Verdict(Struct, frozen=True):
    """Command for the bridge, and the reply to a reset that came with the inputs."""

    name: VerdictName = "inhibited"
    command: Command = STOP
    twist: Twist = STILL  # zero unless the command is RUN
    source: str | None = None  # the source in control, also while safety stops it
    control: str | None = None  # the source, unless a cause forbids every motion
    judged: Token = (0, 0)  # boot and seq of the newest bumper sample taken into account
    reply: Reply | None = None  # to a reset
    limited_by: str | None = None  # the limit source that slows the requested twist
    slowed_by: int | None = None  # the sonar that does
    blocked_by: int | None = None  # the sonar without room for any motion


class State(Struct, frozen=True):
    """Everything besides the inputs that a decision depends on."""

    arbiter: Arbiter
    speed_limits: SpeedLimits
    heartbeat: Heartbeat = Heartbeat()
    latches: Latches = {}
    sonar_array: SonarArray = SonarArray()
    overrides: SonarOverrides = SonarOverrides()
    motion: MotionWatch = MotionWatch()
    fault_budget: FaultBudget = FaultBudget()
    leg: Leg = Leg()
    release: Release = Release()
    decision: int = 0  # number of the newest decision; starts at random, see ``Held.id``
    estop_connection: int = 0  # the newest one
    estop: int | None = None  # the newest ``Link.estop``
    decided_ns: int | None = None
    verdict: Verdict = Verdict()
