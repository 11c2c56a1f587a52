"""Policy fixture: bridge, source and clock for the policy, without a bus."""

import math

import msgspec
from msgspec.structs import replace

from common.freshness import NS_PER_S, Latest
from common.motion import STOP
from services.safety.config import SafetyConfig
from services.safety.core import release_requests
from services.safety.core.causes import latched
from services.safety.core.inputs import (
    DriveRequest,
    Inputs,
    LimitRequest,
    SourceRequest,
)
from services.safety.core.policy import Policy
from services.safety.core.state import Reply, Verdict
from services.safety.report import described, state_message
from t2.messages import (
    SONAR_NAMES,
    Bumper,
    CauseName,
    Direction,
    Drive,
    Driver,
    Limit,
    Message,
    Mileage,
    Motion,
    RangeStatus,
    Release,
    ReleaseRequest,
    ResetRequest,
    SafetyState,
    Switches,
    Ultrasonic,
    Velocity,
)
from t2.words import render
from tests.factories import link, safety_state
from tests.untraced import untraced

TICK_S = 0.02
FREE: tuple[float | None, ...] = (None,) * 8
NO_ECHO_TEXT = (
    "The call carries no echo of safety's heartbeat: send the newest SafetyState.heartbeat as "
    "`echo`."
)
HOLD_TEXT = "The bumper was hit. Hold F to move off forward, or B to move off backward."
UNKNOWN_TEXT = (
    "Safety has restarted: the travel of an earlier release is unknown. Push the vehicle off by "
    "hand, then reset."
)
USED_UP_TEXT = "The distance for moving off is used up. Push the vehicle off by hand, then reset."
DIRECTIONS: tuple[Direction, ...] = ("forward", "backward")
NO_ECHO: tuple[RangeStatus, ...] = ("no_echo",) * 8

LET_GO = render(release_requests.LET_GO)
BUMPER_FREE = render(release_requests.BUMPER_FREE)


class PolicyFixture:
    """Feeds all streams at every tick unless muted; the vehicle moves as commanded."""

    def __init__(self, settings: SafetyConfig | None = None) -> None:
        self.policy = Policy(settings or SafetyConfig())
        self.state = self.policy.start()
        self.now_ns = 10 * NS_PER_S
        self.inputs = Inputs()
        self.verdict = Verdict()
        self.motion = Motion(command=STOP, judged=0)
        self.refused = ""  # why the newest message of a source was refused
        self.muted: set[str] = set()
        self.boot, self.seq = 7, 0
        self.driver_boot, self.driver_seq = 99, 0
        self.keepalive_seq = 0
        self.limit_boot, self.limit_seq = 55, 0
        self.pressed = False
        self.ranges, self.status = FREE, NO_ECHO
        self.linear: float | None = None  # measured; None follows the command
        self.angular: float | None = None
        self.distance = 100.0  # by the counters, which follow what is measured
        self.heading = 0.0
        self.left_bits, self.right_bits = 0, 0
        self.switches = Switches(ultrasonic_brake=True, bumper_brake=True)
        self.link = link()
        self.estop_connection = 1
        self.decide()  # a service decides before anything has come

    def accept(self, request: SourceRequest) -> Verdict:
        """Accept a message of a source, and decide."""
        self.state, self.refused = self.policy.accept(self.state, request, self.now_ns)
        return self.decide()

    def decide(self, *, estop: bool = False, reset: ResetRequest | None = None) -> Verdict:
        inputs = replace(
            self.inputs, estop_connection=self.estop_connection, estop=estop, reset=reset
        )
        decision = self.policy.decide(self.state, inputs, self.now_ns)
        self.motion = decision.motion
        self.state = decision.state
        self.verdict = self.state.verdict
        return self.verdict

    def feed(self) -> None:
        """Feed one sample of every stream that is not muted."""
        self.seq += 1
        sent = self.verdict.twist
        linear = sent.linear if self.linear is None else self.linear
        angular = sent.angular if self.angular is None else self.angular
        if math.isfinite(linear) and math.isfinite(angular):
            self.distance += linear * TICK_S
            self.heading = math.remainder(self.heading + angular * TICK_S, math.tau)
        samples: dict[str, Message] = {
            "velocity": Velocity(linear=linear, angular=angular),
            "mileage": Mileage(distance=self.distance, heading=self.heading, epoch=0),
            "ultrasonic": Ultrasonic(ranges=self.ranges, status=self.status),
            "bumper": Bumper(pressed=self.pressed),
            "left": Driver(faults=(), bits=self.left_bits),
            "right": Driver(faults=(), bits=self.right_bits),
            "switches": self.switches,
            "link": self.link,
            "estop_path": safety_state(),
        }
        for name, sample in samples.items():
            if name not in self.muted:
                self.put(name, sample)

    def put(self, name: str, sample: Message) -> None:
        stamped = msgspec.structs.replace(sample, seq=self.seq, boot=self.boot)
        latest = Latest(stamped, self.now_ns)
        self.inputs = replace(self.inputs, **{name: latest})

    def tick(self, ticks: int = 1) -> Verdict:
        """Advance the time, with samples."""
        for _ in range(ticks):
            self.now_ns += round(TICK_S * NS_PER_S)
            self.feed()
            self.state = replace(self.state, heartbeat=self.state.heartbeat.beat(self.now_ns))
            self.decide()
        return self.verdict

    def request(
        self,
        linear: float = 0.0,
        angular: float = 0.0,
        source: str = "teleop",
        *,
        release: ReleaseRequest = "none",
        echo: int | None = None,
    ) -> Verdict:
        """Put one request."""
        self.driver_seq += 1
        drive = Drive(
            linear=linear,
            angular=angular,
            release=release,
            echo=self.echo if echo is None else echo,
            seq=self.driver_seq,
            boot=self.driver_boot,
        )
        return self.accept(DriveRequest(source, drive, self.now_ns))

    def limit(
        self,
        linear: float | None = None,
        angular: float | None = None,
        reason: str = "",
        source: str = "lidar",
        echo: int | None = None,
    ) -> Verdict:
        """Put one speed limit."""
        self.limit_seq += 1
        limit = Limit(
            linear=linear, angular=angular, reason=reason,
            echo=self.echo if echo is None else echo, seq=self.limit_seq, boot=self.limit_boot,
        )  # fmt: skip
        return self.accept(LimitRequest(source, limit, self.now_ns))

    def keepalive(self, source: str = "pendant", echo: int | None = None) -> Verdict:
        """Put one keepalive."""
        self.keepalive_seq += 1
        message = Limit(
            echo=self.echo if echo is None else echo,
            seq=self.keepalive_seq,
            boot=66,
        )
        return self.accept(LimitRequest(source, message, self.now_ns))

    def drive(
        self,
        linear: float = 0.0,
        angular: float = 0.0,
        seconds: float = 0.2,
        source: str = "teleop",
    ) -> Verdict:
        """Repeat a request at every tick for a while."""
        for _ in range(round(seconds / TICK_S)):
            self.tick()
            self.request(linear, angular, source)
        return self.verdict

    @untraced()
    def ready(self) -> "PolicyFixture":
        """Start, and send neutral requests."""
        self.tick(40)
        self.drive()
        assert self.verdict.command == "run", self.state.latches
        return self

    @untraced()
    def running(self, linear: float = 0.5, angular: float = 0.0) -> "PolicyFixture":
        """Start and drive."""
        self.ready().drive(linear, angular, 2.0)
        assert self.verdict.command == "run", self.state.latches
        return self

    @property
    def echo(self) -> int:
        """The newest heartbeat."""
        return self.state.heartbeat.number

    def latched(self) -> tuple[int, ...]:
        """Return the identities of all latched causes, as an operator sees them now."""
        return tuple(self.state.latches[name].id for name in latched(self.state.latches))

    def reset(self, *causes: int, echo: int | None = None) -> str:
        """Reset these causes, all by default; return the reason of a refusal."""
        call = ResetRequest(echo=echo or self.echo, causes=causes or self.latched())
        self.decide(reset=call)
        return "" if self.reply().done else self.answer()

    def hold(
        self, direction: Direction = "backward", ticks: int = 0, source: str = "teleop"
    ) -> str:
        """Request the release, for some more ticks; return why it does not move the vehicle."""
        self.request(release=direction, source=source)
        for _ in range(ticks):
            self.tick()
            self.request(release=direction, source=source)
        return render(self.state.release.refusal)

    def let_go(self, ticks: int = 1) -> Verdict:
        """Request zero for some ticks."""
        for _ in range(ticks):
            self.tick()
            self.now_ns += 1  # no two decisions have one time
            self.request()
        return self.verdict

    def published(self) -> SafetyState:
        """Return the published state."""
        return state_message(self.policy, self.state, self.now_ns)

    def release(self) -> Release:
        """Return the published release of a latched contact."""
        release = self.published().release
        assert release is not None
        return release

    def reply(self) -> Reply:
        """Return the reply to the call of the last decision."""
        assert self.verdict.reply is not None
        return self.verdict.reply

    def answer(self) -> str:
        """Return the text of that reply."""
        return render(self.reply().phrases)

    def text(self, name: CauseName) -> str:
        """Return the published text of a held cause."""
        return render(described(self.state, name))

    def estop(self) -> Verdict:
        return self.decide(estop=True)

    def sonar(self, **distances: float | None) -> None:
        """Set readings by the sonar's name; None is a fault."""
        ranges, status = list(self.ranges), list(self.status)
        for name, distance in distances.items():
            n = SONAR_NAMES.index(name)
            ranges[n] = distance
            status[n] = "ok" if distance is not None else "fault"
        self.ranges, self.status = tuple(ranges), tuple(status)


@untraced()
def hit() -> PolicyFixture:
    """Drive forward into something, let go, and stand there, pressed."""
    fixture = PolicyFixture().running()
    fixture.pressed = True
    fixture.tick()
    fixture.linear = 0.0
    fixture.let_go(40)
    fixture.linear = None
    return fixture
