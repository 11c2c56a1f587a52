"""Which ``cmd_vel`` may become a drive request. Pure.

**Delay.** ROS messages carry the time of the sender's clock, which need not agree with ours. For
each publisher the difference of our receive time and that time has a minimum, the fastest delivery
so far. It rises slowly, as clocks drift. A command that took ``HELD_BACK_NS`` longer than that was
held back by the network or by a busy host, and must not move the robot. At the start there is no
such minimum: a publisher *settles* until the minimum has been steady for ``SETTLE_NS``.

**Neutral.** In ROS no request is silence. So a pause of ``PAUSE_NS``, by the publisher's clock and
by ours, counts as neutral: silence, or zeros. With ``by_zero`` only zeros count, after settling. A
lost command may have commanded motion, so a gap in the sequence is no pause. Of a new publisher the
first ``UNHEARD`` commands may be lost, because ROS does not wait for a match.

**States of a publisher.** One drives at a time. The state changes before the command is judged:

| state      | event                                              | next       | to safety         |
| ---------- | -------------------------------------------------- | ---------- | ----------------- |
| (new)      | its first command                                  | must pause |                   |
| must pause | a command after a pause, while no other one drives | settling   | a neutral request |
| settling   | a command before ``SETTLE_NS``                     | settling   | a neutral request |
| settling   | a delivery that shows that the pause was a delay   | must pause |                   |
| settling   | a command ``SETTLE_NS`` later                      | drives     | the command       |
| drives     | a command                                          | drives     | the command       |
| drives     | a command after a pause                            | drives     | a neutral request,|
|            |                                                    |            | then the command  |
| any        | motion while safety bars it, or another one drives | must pause |                   |
| any        | a command after ``LAPSE_NS`` without one           | must pause |                   |

Safety wants a new neutral request when the vehicle stood without one, so each command of a settling
publisher sends it.
"""

from typing import NamedTuple

from msgspec import Struct

from common.freshness import NS_PER_S
from services.ros2.cdr import Attachment
from t2.client import Contest
from t2.messages import MAX_NUMBER, SafetyState

HELD_BACK_NS = NS_PER_S // 5
SETTLE_NS = NS_PER_S // 2
PAUSE_NS = NS_PER_S // 2  # silence, or zeros, that count as neutral
LAPSE_NS = NS_PER_S  # of silence, after which a publisher begins anew
FASTER_NS = NS_PER_S // 50  # a delivery this much faster starts the settling anew
DRIFT = 5e-4  # s of the minimum per s: what clocks that are slewed drift apart at most
OWNER_NS = NS_PER_S // 2  # silence after which another publisher may drive
SOURCE = "ros2"  # of the drive requests
UNHEARD = 20  # 1 s at the usual 20 Hz
MAX_PUBLISHERS = 64  # remembered; the one that was silent longest is dropped first

# m/s and rad/s: the finest step of a motion frame, by either angular unit. What is less is zero.
STEP = 0.001

Axes = tuple[float, float, float]


class Twist(NamedTuple):
    """A received command: m/s and rad/s in ``base_link``."""

    linear: Axes
    angular: Axes

    def in_steps(self) -> "Twist":
        """Return it with zeros where a motion frame cannot represent the number."""
        return Twist(_in_steps(self.linear), _in_steps(self.angular))

    @property
    def moves(self) -> bool:
        """Whether it is not neutral."""
        return any((*self.linear, *self.angular))


class Refusal(NamedTuple):
    """Why a command is not passed on."""

    name: str  # for counters; its text in the catalogue is ``cmd_vel.NAME``
    is_neutral: bool = False  # whether safety gets a neutral request instead


OUT_OF_ORDER = Refusal("out_of_order")
HELD_BACK = Refusal("held_back")
SETTLING = Refusal("settling")
BEGINS = SETTLING._replace(is_neutral=True)
SETTLES = SETTLING._replace(is_neutral=True)
SECOND_PUBLISHER = Refusal("second_publisher")
NOT_PAUSED = Refusal("not_paused")
NOT_ZERO = Refusal("not_zero")
NOT_FINITE = Refusal("not_finite")
OTHER_AXES = Refusal("other_axes")


# Causes that stop, and after which safety wants no neutral request.
TRANSIENT = frozenset({"blocked", "no_request"})


def bars_motion(state: SafetyState | None) -> bool:
    """Return whether safety wants a neutral request before the next motion, by its newest state."""
    return state is not None and any(
        cause.action in ("stop", "brake") and cause.name not in TRANSIENT for cause in state.causes
    )


class Request(NamedTuple):
    """A command to pass on to safety."""

    linear: float  # m/s
    angular: float  # rad/s
    neutral_first: bool = False  # after a pause: safety wants it if the vehicle stood meanwhile


class Publisher(Struct):
    """What is known of one sender."""

    least_ns: int  # the fastest delivery: our monotonic time less the sender's time
    anchor_ns: int  # the fastest delivery when the settling began
    settling_ns: int  # when it began
    received_ns: int
    moved_ns: int  # when it last commanded motion, or may have
    moved_source_ns: int  # the same by its clock
    sequence: int
    begun_ns: int | None = None  # the delivery of the command by which it began; None: it must

    def note(self, about: Attachment, twist: Twist, now_ns: int) -> bool:
        """Note a delivery; return whether the publisher had paused before."""
        if about.sequence != self.sequence + 1:  # what is lost may have commanded motion
            self._move(about, now_ns)
        pause_ns = min(now_ns - self.moved_ns, about.source_ns - self.moved_source_ns)
        if twist.moves:
            self._move(about, now_ns)
        silent_ns, delivery_ns = now_ns - self.received_ns, now_ns - about.source_ns
        self.least_ns = min(self.least_ns + round(DRIFT * silent_ns), delivery_ns)
        if silent_ns >= LAPSE_NS:
            self.begun_ns = None
        if silent_ns >= LAPSE_NS or self.least_ns < self.anchor_ns - FASTER_NS:
            self.settle(now_ns)
        self.received_ns, self.sequence = now_ns, about.sequence
        return pause_ns >= PAUSE_NS

    def settle(self, now_ns: int) -> None:
        """Start the settling anew."""
        self.anchor_ns, self.settling_ns = self.least_ns, now_ns

    @property
    def is_settling(self) -> bool:
        """Whether its delay was not steady for long enough when it was last received."""
        return self.received_ns - self.settling_ns < SETTLE_NS

    @property
    def began_late(self) -> bool:
        """Whether the command by which it began was held back, as faster ones show."""
        return self.begun_ns is not None and self.begun_ns - self.least_ns > HELD_BACK_NS

    def _move(self, about: Attachment, now_ns: int) -> None:
        self.moved_ns, self.moved_source_ns = now_ns, about.source_ns


class Commands:
    """Decides about each command; keeps what is known of its publishers."""

    _owned_ns: int  # when the owner drove last
    _since_ns: int  # of ``listen``
    _contest: Contest  # of the owner, since it began

    def __init__(self, *, by_zero: bool = False) -> None:
        self.owner: bytes | None = None  # GID of the publisher that drives
        self._by_zero = by_zero  # whether only zeros are neutral
        self._known: dict[bytes, Publisher] = {}

    def listen(self, now_ns: int) -> None:
        """Begin to receive, before the first command: what its publisher did before is unknown."""
        self._since_ns = now_ns

    def judge(
        self,
        about: Attachment,
        twist: Twist,
        received_ns: int,
        now_ns: int,
        state: SafetyState | None,
    ) -> Request | Refusal:
        """Return the request of a command, or the refusal; times are of our monotonic clock.

        ``state`` is safety's newest one.
        """
        twist = twist.in_steps()
        known = self._publisher(about, received_ns)
        if about.sequence <= known.sequence:
            return OUT_OF_ORDER
        has_paused = known.note(about, twist, received_ns)
        if twist.moves and (bars_motion(state) or self._is_overruled(known, about.gid, state)):
            has_paused, known.begun_ns = False, None
        if refusal := _of_content(twist):
            return refusal
        if now_ns - about.source_ns - known.least_ns > HELD_BACK_NS:
            return HELD_BACK
        if self._another_drives(about.gid, received_ns):
            known.begun_ns = None
            return SECOND_PUBLISHER
        if self.owner != about.gid and known.began_late:
            known.begun_ns = None
        if refusal := self._of_beginning(known, about, twist, has_paused=has_paused):
            return refusal
        self.owner, self._owned_ns = about.gid, received_ns
        resumes = has_paused and twist.moves and not self._by_zero
        return Request(twist.linear[0], twist.angular[2], neutral_first=resumes)

    def gone(self, gid: bytes) -> None:
        """Let others drive: the publisher's token disappeared."""
        if self.owner == gid:
            self.owner = None

    def _publisher(self, about: Attachment, now_ns: int) -> Publisher:
        known = self._known.pop(about.gid, None)
        if known is None:
            delivery_ns = now_ns - about.source_ns
            known = Publisher(
                least_ns=delivery_ns,
                anchor_ns=delivery_ns,
                settling_ns=now_ns,
                received_ns=now_ns,
                moved_ns=self._since_ns,
                moved_source_ns=self._since_ns - delivery_ns,
                sequence=about.sequence - 1 if about.sequence <= UNHEARD else 0,
            )
        self._known[about.gid] = known  # the last one of the dictionary
        if len(self._known) > MAX_PUBLISHERS:
            del self._known[next(iter(self._known))]
        return known

    def _is_overruled(self, known: Publisher, gid: bytes, state: SafetyState | None) -> bool:
        """Return whether another source drives although this publisher commands motion."""
        if self.owner != gid or known.begun_ns is None or known.is_settling:
            return False
        self._contest.tick(state, requests=True)
        return self._contest.is_lost

    def _another_drives(self, gid: bytes, now_ns: int) -> bool:
        return self.owner not in (None, gid) and now_ns - self._owned_ns < OWNER_NS

    def _of_beginning(
        self, known: Publisher, about: Attachment, twist: Twist, *, has_paused: bool
    ) -> Refusal | None:
        """Return the refusal of a publisher that does not drive yet."""
        if known.begun_ns is None and not self._by_zero:
            if not has_paused:
                return NOT_PAUSED
            self._begin(known, about)
            known.settle(known.received_ns)
            return BEGINS
        if known.is_settling:
            return SETTLING if known.begun_ns is None else SETTLES
        if known.begun_ns is None:
            if twist.moves:
                return NOT_ZERO
            self._begin(known, about)
        return None

    def _begin(self, known: Publisher, about: Attachment) -> None:
        known.begun_ns = known.received_ns - about.source_ns
        self._contest = Contest(SOURCE)


def _in_steps(axes: Axes) -> Axes:
    x, y, z = (0.0 if abs(number) < STEP else number for number in axes)  # NaN stays
    return x, y, z


def _of_content(twist: Twist) -> Refusal | None:
    if not all(abs(number) <= MAX_NUMBER for number in (*twist.linear, *twist.angular)):
        return NOT_FINITE
    if any((*twist.linear[1:], *twist.angular[:2])):
        return OTHER_AXES
    return None
