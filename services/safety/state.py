"""What safety remembers from one decision to the next, and what a decision is."""

from msgspec import Struct

from common.heartbeat import Heartbeat
from common.messages import Verdict as VerdictName
from common.motion import STILL, STOP, Command, Twist
from services.safety.arbiter import Arbiter
from services.safety.blind import Blind
from services.safety.fault_budget import FaultBudget
from services.safety.latches import Latches, Token
from services.safety.release import Release
from services.safety.runaway import Axis
from services.safety.sonar_array import Heard
from services.safety.standstill import Standstill
from services.safety.trajectory import Trajectory

RELEASE = "release"  # stands where a source stands while the vehicle creeps off its bumper


class Reply(Struct, frozen=True):
    """What a reset or a release is answered."""

    done: bool
    text: str
    cleared: tuple[int, ...] = ()  # identities of the causes that a reset cleared


class Verdict(Struct, frozen=True):
    """What the bridge is told, and what became of the event that came with the inputs."""

    name: VerdictName = "inhibited"
    command: Command = STOP
    twist: Twist = STILL  # still unless the command is to run
    source: str | None = None  # who drives, or would if safety let it
    judged: Token = (0, 0)  # boot and seq of the newest bumper sample that was judged
    reply: Reply | None = None  # to a reset or a hold
    refused: str = ""  # why the request was refused, by the names in ``arbiter.py``


class State(Struct, frozen=True):
    """Everything that decisions depend on besides the inputs."""

    arbiter: Arbiter
    heartbeat: Heartbeat = Heartbeat()
    latches: Latches = {}
    heard: Heard = Heard()
    blind: Blind = Blind()
    linear: Axis = Axis()
    angular: Axis = Axis()
    standstill: Standstill = Standstill()
    credit: FaultBudget = FaultBudget()
    release: Release = Release()
    trajectory: Trajectory = Trajectory()
    decision: int = 0  # the number of the newest one; starts at random, see ``Held.id``
    reader_was_up: bool = False
    decided_ns: int | None = None
    verdict: Verdict = Verdict()
