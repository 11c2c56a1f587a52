"""When a picture was taken, as a heartbeat of safety. Pure.

==================================== ==========================================================
a picture                            carries
==================================== ==========================================================
that arrives in time                 the newest heartbeat that was received before it was taken
late, by the times of its source     the heartbeat of that earlier time
out of a buffer, without such times  nothing: it is not published
equal to those before it, in motion  from 2 cm or 0.02 rad on the heartbeat of before that motion,
                                     until a picture differs: frozen
of a file, or without safety         no heartbeat
==================================== ==========================================================
"""

from msgspec import Struct

from common.freshness import NS_PER_S
from common.heartbeat import Heartbeat
from t2.messages import Velocity

# The source's clock may be slower than ours by this share: later pictures are not late for that.
DRIFT_PPM = 500
WAITED_NS = NS_PER_S // 500  # a picture that is there sooner was waiting in a buffer
MOVING_MPS, MOVING_RADPS = 0.05, 0.1
# Pictures may be equal over less: of a plain wall, or of the simulator, which has no noise.
CHANGED_M, CHANGED_RAD = 0.02, 0.02


def moved(velocity: Velocity, seconds: float) -> float:
    """Return the motion of some seconds as a share of that over which pictures must differ."""
    linear, angular = abs(velocity.linear), abs(velocity.angular)
    if linear <= MOVING_MPS and angular <= MOVING_RADPS:  # noise, or the last bit of a stop
        return 0.0
    return seconds * max(linear / CHANGED_M, angular / CHANGED_RAD)


def heartbeat_before(heartbeat: Heartbeat, at_ns: int) -> int | None:
    """Return the newest number that was received until this time."""
    return next((number for number, got_ns in reversed(heartbeat.sent) if got_ns <= at_ns), None)


class Lateness(Struct, frozen=True):
    """How late pictures arrive, compared with the earliest one, by the times of their source."""

    offset_ns: int | None = None  # from the source's clock to ours, of the earliest picture
    source_ns: int = 0  # of the last picture
    now_ns: int = 0

    def arrived(self, source_ns: int, now_ns: int) -> "Lateness":
        """Return the lateness with a picture; times that jump back begin anew."""
        offset_ns = now_ns - source_ns
        if self.offset_ns is not None and source_ns > self.source_ns:
            drift_ns = (now_ns - self.now_ns) * DRIFT_PPM // 1_000_000
            offset_ns = min(offset_ns, self.offset_ns + drift_ns)
        return Lateness(offset_ns, source_ns, now_ns)

    @property
    def late_ns(self) -> int:
        """How late the last picture was."""
        return self.now_ns - self.source_ns - (self.offset_ns or 0)


class Watch(Struct, frozen=True):
    """The last picture, and how far the vehicle has moved since pictures are equal to it."""

    jpeg: bytes = b""
    heartbeat: int | None = None
    still: int | None = None  # the heartbeat before that motion
    moved: float = 0.0  # as a share of that over which pictures must differ

    @property
    def is_frozen(self) -> bool:
        """Whether pictures do not change although the vehicle moves."""
        return self.moved >= 1.0

    def seen(self, jpeg: bytes, heartbeat: int | None, moved: float) -> "Watch":
        """Return the watch with a picture that was taken at this heartbeat, after this motion."""
        if jpeg != self.jpeg:
            return Watch(jpeg, heartbeat, heartbeat)
        total = self.moved + moved
        still = self.still if total else heartbeat
        return Watch(jpeg, still if total >= 1.0 else heartbeat, still, total)
