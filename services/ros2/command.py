"""Which ``cmd_vel`` may become a drive request. Pure.

ROS messages carry the time of the sender's clock, which need not agree with ours. For each
publisher the difference of our receive time and that time has a minimum: the fastest delivery so
far. A command that took ``HELD_BACK_NS`` longer, until it was judged, was held back by the network
or by a busy host, and must not move the robot. A burst of old commands at the start has no such
minimum yet: commands are taken only from a publisher whose minimum has been steady for
``SETTLE_NS``. The minimum rises slowly, as clocks drift. A publisher that was silent for
``IDLE_NS`` counts as a new one.

One publisher drives at a time, and begins with a neutral command. Safety cannot require that: to it
all publishers are one source. A command is passed on once, as it is: it is never repeated, and no
neutral command is invented.
"""

from typing import NamedTuple

from msgspec import Struct

from common.freshness import NS_PER_S
from common.messages import MAX_NUMBER
from services.ros2.cdr import Attachment

HELD_BACK_NS = NS_PER_S // 5
SETTLE_NS = NS_PER_S // 2
FASTER_NS = NS_PER_S // 50  # a delivery this much faster starts the settling anew
DRIFT = 5e-4  # s of the minimum per s: what clocks that are slewed drift apart at most
OWNER_NS = NS_PER_S // 2  # silence after which another publisher may drive
IDLE_NS = 60 * NS_PER_S  # silence after which a publisher is forgotten
MAX_PUBLISHERS = 64  # remembered; the one that was silent longest is dropped first

Axes = tuple[float, float, float]


class Twist(NamedTuple):
    """A received command: m/s and rad/s in ``base_link``."""

    linear: Axes
    angular: Axes

    @property
    def moves(self) -> bool:
        """Whether it is not neutral."""
        return any((*self.linear, *self.angular))


class Refusal(NamedTuple):
    """Why a command is not passed on."""

    name: str  # for counters and events
    text: str


OUT_OF_ORDER = Refusal("out_of_order", "A command arrived again, or after a later one.")
HELD_BACK = Refusal(
    "held_back",
    "A command took over 0.2 s longer than the fastest of its publisher. The network held it back, "
    "or the publisher's clock was set: restart that node.",
)
SETTLING = Refusal("settling", "A publisher is new, or its delay changes. Commands are taken soon.")
SECOND_PUBLISHER = Refusal("second_publisher", "Another publisher drives. One at a time may.")
NOT_NEUTRAL = Refusal(
    "not_neutral", "A publisher that begins to drive must send a neutral command."
)
NOT_FINITE = Refusal("not_finite", "A command has a number that is not finite, or over 1e9.")
OTHER_AXES = Refusal(
    "other_axes",
    "A command asks for motion other than linear.x and angular.z. The vehicle cannot drive "
    "sideways through this interface.",
)


class Request(NamedTuple):
    """A command to pass on to safety."""

    linear: float  # m/s
    angular: float  # rad/s


class Publisher(Struct):
    """What is known of one sender."""

    least_ns: int  # the fastest delivery: our monotonic time less the sender's time
    anchor_ns: int  # the fastest delivery when the settling began
    settling_ns: int  # when it began
    received_ns: int
    sequence: int = 0


class Commands:
    """Decides about each command; keeps what is known of its publishers."""

    _owned_ns: int  # when the owner drove last

    def __init__(self) -> None:
        self.owner: bytes | None = None  # GID of the publisher that drives
        self._known: dict[bytes, Publisher] = {}

    def judge(
        self, about: Attachment, twist: Twist, received_ns: int, now_ns: int
    ) -> Request | Refusal:
        """Return the request of a command, or the refusal; times are of our monotonic clock."""
        known = self._known.get(about.gid)
        if known is not None and received_ns - known.received_ns > IDLE_NS:
            self.gone(about.gid)
            known = None
        if known is not None and about.sequence <= known.sequence:
            return OUT_OF_ORDER
        delay_ns = self._noted(about, received_ns) + now_ns - received_ns
        if refusal := _of_content(twist):
            return refusal
        if delay_ns > HELD_BACK_NS:
            return HELD_BACK
        if self._is_settling(about.gid, received_ns):
            return SETTLING
        return self._of_owner(about.gid, received_ns, twist) or Request(
            twist.linear[0], twist.angular[2]
        )

    def gone(self, gid: bytes) -> None:
        """Forget a publisher whose token disappeared."""
        self._known.pop(gid, None)
        if self.owner == gid:
            self.owner = None

    def _noted(self, about: Attachment, now_ns: int) -> int:
        """Note a delivery; return how much longer it took than the fastest one."""
        passed_ns = now_ns - about.source_ns
        known = self._known.pop(about.gid, None)
        if known is None:
            known = Publisher(passed_ns, passed_ns, now_ns, now_ns)
        least_ns = known.least_ns + round(DRIFT * (now_ns - known.received_ns))
        known.least_ns = min(least_ns, passed_ns)
        if known.least_ns < known.anchor_ns - FASTER_NS:
            known.anchor_ns, known.settling_ns = known.least_ns, now_ns
        known.received_ns, known.sequence = now_ns, about.sequence
        self._known[about.gid] = known  # the last one of the dictionary
        if len(self._known) > MAX_PUBLISHERS:
            del self._known[next(iter(self._known))]
        return passed_ns - known.least_ns

    def _is_settling(self, gid: bytes, now_ns: int) -> bool:
        return now_ns - self._known[gid].settling_ns < SETTLE_NS

    def _of_owner(self, gid: bytes, now_ns: int, twist: Twist) -> Refusal | None:
        """Return the refusal of a publisher that does not drive; a neutral command begins."""
        if self.owner != gid:
            if self.owner is not None and now_ns - self._owned_ns < OWNER_NS:
                return SECOND_PUBLISHER
            if twist.moves:
                return NOT_NEUTRAL
        self.owner, self._owned_ns = gid, now_ns
        return None


def _of_content(twist: Twist) -> Refusal | None:
    if not all(abs(number) <= MAX_NUMBER for number in (*twist.linear, *twist.angular)):
        return NOT_FINITE
    if any((*twist.linear[1:], *twist.angular[:2])):
        return OTHER_AXES
    return None
