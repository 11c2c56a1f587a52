"""What the wheels are told: one motion authority, its lease, and the reflex.

The board has no documented watchdog, so it is never left with a RUN that nobody stands behind. A
motion message is turned into one frame at once and holds for the lease. A RUN is obeyed only while
all of this is so; otherwise STOP goes out in its place:

========== ================================ ==================================================
condition  lost by                          regained by
========== ================================ ==================================================
ready      link lost, switches unverified,  both emergency switches on and echoed
           board restarted, stopping
neutral    start, not ready, lease over,    a STOP or a RUN of zero from the authority, while
           a new authority                  ready: nothing moves because something came back
judged     a bumper hit (the reflex: BREAK  a motion message whose ``judged`` covers that hit:
           at once)                         a RUN that was under way must not undo the BREAK
still      0.05 m or 0.05 rad away from a   a motion message that says safety has latched this:
           standstill while the lease was   its ``predecessor`` is the bridge itself
           over: BREAK at once
heir       an authority that ended with a   its successor has latched in its place, and says
           latch that nobody has reset      by ``predecessor`` that it knows whose latch it is
========== ================================ ==================================================

When the lease is over: STOP at once and at 20 Hz for ever, and BREAK from ``coast_ns`` on while the
vehicle is not known to stand (``standstill`` says how long that is). BREAK goes on if it was the
authority's last order. The authority is the ``boot``
of the sender; as long as its lease lives another is refused.

The lease counts from when a motion was received, not from when it is handled: a message that
waited for longer than the lease renews nothing and is not obeyed, except a BREAK. While the lease
lives, ``seq`` may rise by 2^20 at most: a copied ``boot`` with a huge ``seq`` must not lock the
authority out. An authority that was not received for hours is taken again.

A latch must outlive the safety service that holds it: whose it is, is remembered here until the
same one says that it was reset, or its heir has taken it on. A successor that latches for a reason
of its own, before it has heard of the latch that is due, takes nothing on. A motion without a
command is such a latch, too, and it is the bridge's own until a safety service has taken it on.
"""

from enum import StrEnum

from msgspec import Struct
from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.messages import Motion
from common.motion import BRAKE, RUN, STOP, Command

STOP_PERIOD_NS = NS_PER_S // 20
AT_ONCE = -STOP_PERIOD_NS  # as a send time: so long ago that the next STOP is due
SEQ_STEP_MAX = 1 << 20  # over three hours: safety makes 50 to 90 decisions a second


class Refusal(StrEnum):
    """Why a motion message, or the RUN in it, was not obeyed."""

    SECOND_AUTHORITY = "second_authority"
    OLD = "seq_not_rising"
    JUMP = "seq_jumps"
    LATE = "too_late"
    NOT_READY = "not_ready"
    NOT_NEUTRAL = "waiting_for_neutral"
    NOT_JUDGED = "hit_not_judged"
    NOT_HEIR = "latch_not_taken_on"


class Lease(Struct, frozen=True):
    """Who may move the vehicle, until when, and what is missing."""

    boot: int | None = None  # the authority's
    seq: int = 0  # its newest message
    renewed_ns: int = 0
    over_since_ns: int | None = 0  # None while the lease lives
    ready: bool = False
    neutral: bool = False
    hit: int | None = None  # ``seq`` of the bumper sample that awaits judgement
    sent_ns: int = 0
    latched_by: int | None = None  # the authority whose latch nobody has reset, or the bridge
    braked: bool = False  # whether the authority's last order was BREAK
    uncommanded: bool = False  # it moved away from a standstill, which safety has not latched yet

    @property
    def braking(self) -> bool:
        """Whether BREAK lasts, whether or not the vehicle stands."""
        return self.hit is not None or self.uncommanded or self.braked

    @property
    def waiting(self) -> str:
        """Say in words why a RUN would not be obeyed; empty when it would."""
        if not self.ready:
            return "the board is not ready"
        if self.hit is not None:
            return "safety has not judged the bumper hit"
        if self.uncommanded:
            return "the vehicle moved without a command: safety has not latched that yet"
        if self.latched_by not in (None, self.boot):
            return "safety has not taken on the latch of the one before it"
        if not self.neutral:
            return "a neutral motion from safety is due"
        return ""


def on_motion(
    lease: Lease, motion: Motion, now_ns: int, lease_ns: int, own_boot: int, *, received_ns: int
) -> tuple[Lease, Command | None, Refusal | None]:
    """Judge one motion message; return the order to send, if any, and what was refused."""
    if refusal := _refusal(lease, motion, now_ns, lease_ns):
        return lease, None, refusal
    if now_ns - received_ns > lease_ns:
        brake = motion.command is BRAKE
        lease = replace(lease, braked=True) if brake else lease
        return lease, BRAKE if brake else None, Refusal.LATE
    if motion.boot != lease.boot:
        lease = replace(lease, boot=motion.boot)  # the end of the last one's took the neutral
    lease = expire(lease, now_ns, lease_ns)
    lease = replace(lease, seq=motion.seq, renewed_ns=received_ns, over_since_ns=None)
    if motion.judged_boot == own_boot and lease.hit is not None and motion.judged >= lease.hit:
        lease = replace(lease, hit=None)
    latched_by = _latched_by(lease, motion)
    uncommanded = lease.uncommanded and latched_by == own_boot
    lease = replace(lease, latched_by=latched_by, uncommanded=uncommanded)
    order, refusal = _order(lease, motion)
    # A RUN that moves is obeyed only when the lease is neutral already.
    neutral = lease.neutral or (lease.ready and refusal is None)
    braked = order is BRAKE
    return replace(lease, neutral=neutral, sent_ns=now_ns, braked=braked), order, refusal


def _refusal(lease: Lease, motion: Motion, now_ns: int, lease_ns: int) -> Refusal | None:
    """Return why a message is not taken at all, by its sender and its number."""
    lives = lease.boot is not None and now_ns - lease.renewed_ns <= lease_ns
    if motion.boot != lease.boot:
        return Refusal.SECOND_AUTHORITY if lives else None
    if motion.seq <= lease.seq:
        return Refusal.OLD
    return Refusal.JUMP if lives and motion.seq - lease.seq > SEQ_STEP_MAX else None


def is_neutral(motion: Motion) -> bool:
    """Return whether a motion moves nothing."""
    return motion.command is not RUN or (motion.linear == 0 and motion.angular == 0)


def _latched_by(lease: Lease, motion: Motion) -> int | None:
    """Return whose latch waits for a reset after this motion of the authority."""
    if not motion.latched:
        return None if lease.latched_by == motion.boot else lease.latched_by
    knows = lease.latched_by in (None, motion.boot, motion.predecessor)
    return motion.boot if knows else lease.latched_by


def _order(lease: Lease, motion: Motion) -> tuple[Command, Refusal | None]:
    if lease.hit is not None or lease.uncommanded:
        refusal = Refusal.NOT_HEIR if lease.hit is None else Refusal.NOT_JUDGED
        return BRAKE, refusal if motion.command is RUN else None
    if motion.command is not RUN:
        return motion.command, None
    if lease.latched_by not in (None, motion.boot):
        return STOP, Refusal.NOT_HEIR
    if not lease.ready:
        return STOP, Refusal.NOT_READY
    if not (lease.neutral or is_neutral(motion)):
        return STOP, Refusal.NOT_NEUTRAL
    return RUN, None


def on_hit(lease: Lease, seq: int, now_ns: int) -> tuple[Lease, Command]:
    """Answer the first sample of a bumper hit: the reflex."""
    return replace(lease, hit=seq, sent_ns=now_ns), BRAKE


def on_uncommanded(lease: Lease, now_ns: int, own_boot: int) -> tuple[Lease, Command | None]:
    """Latch that the vehicle moved away from where it stood while the lease is over."""
    if lease.over_since_ns is None or lease.uncommanded:
        return lease, None
    moved = replace(lease, uncommanded=True, latched_by=own_boot, sent_ns=now_ns)
    return moved, BRAKE


def on_ready(lease: Lease, ready: bool) -> Lease:
    """Take in whether the board may be driven; losing that takes the neutral along."""
    if ready == lease.ready:
        return lease
    return replace(lease, ready=ready, neutral=False, sent_ns=lease.sent_ns if ready else AT_ONCE)


def expire(lease: Lease, now_ns: int, lease_ns: int) -> Lease:
    """Note when the lease has run out; it takes the neutral along."""
    if lease.over_since_ns is not None or now_ns - lease.renewed_ns <= lease_ns:
        return lease
    return replace(lease, over_since_ns=now_ns, neutral=False, sent_ns=AT_ONCE)


def on_tick(
    lease: Lease, now_ns: int, lease_ns: int, coast_ns: int, standing: bool
) -> tuple[Lease, Command | None]:
    """Return what must be sent by now although no motion message asked for it."""
    lease = expire(lease, now_ns, lease_ns)
    if lease.over_since_ns is None and lease.ready:
        return lease, None
    if now_ns - lease.sent_ns < STOP_PERIOD_NS:
        return lease, None
    since_ns = lease.over_since_ns
    coasted = since_ns is not None and now_ns - since_ns > coast_ns
    brake = lease.braking or (coasted and not standing)
    return replace(lease, sent_ns=now_ns), BRAKE if brake else STOP
