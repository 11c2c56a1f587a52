"""Motion lease: one motion authority, its time limit, and the bumper reflex. Pure.

The board has no documented watchdog, so it must never hold a RUN that no running service renews. A
motion message becomes one frame at once and is valid for the lease. A RUN is obeyed only while all
of these conditions hold. Without one of the first three BRAKE is sent instead, otherwise STOP:

============ =============================== =================================================
condition    lost by                         regained by
============ =============================== =================================================
estop        an emergency stop: BRAKE at     a motion message whose ``estop`` names that stop: a
             once                            safety that hangs or restarts does not lose it
hit          a bumper hit (the reflex: BRAKE a motion message whose ``judged`` covers that hit:
             at once)                        a RUN that was already sent must not undo the BRAKE
uncommanded  leaving a standstill while the  a motion message with safety's latch for this:
             lease was over: BRAKE at once   its ``predecessor`` is the bridge itself
latch owner  an authority that ended with a  its successor has latched in its place, and names
             latch that was not reset        the owner of that latch in ``predecessor``
ready        link lost, brakes unverified,   both emergency brakes on, confirmed
             board restarted, stopping
neutral      start, not ready, lease over,   a STOP, BRAKE or RUN of 0 from the authority, while
             a new authority                 ready: no motion on reconnect alone
============ =============================== =================================================

When the lease is over: STOP at once and then at 25 Hz, and BRAKE from ``coast_ns`` on while the
vehicle is not known to be at standstill (``motion_output`` defines that time). BRAKE continues if
it was the authority's last order. The authority is identified by the ``boot`` of the sender; until
its lease is over, others are refused.

A bridge begins with the BRAKE that its guard sent last. It continues for ``BEGIN_NS`` until the
first motion of an authority, so that STOP does not replace a BRAKE that safety is about to repeat.
Where the bridge before held BRAKE (``braked``), it continues without a limit.

The lease counts from reception of a motion, not from its handling: a message that was queued for
longer than the lease renews nothing and is not obeyed, except a BRAKE.

A latch must outlive the safety service that holds it: the bridge stores its owner until the same
service reports the reset, or the successor has taken the latch over. A successor that latches for
another reason, before it has received the pending latch, takes nothing over. A motion without a
command is such a latch, too; the bridge itself owns it until a safety service has taken it over.
"""

from enum import StrEnum

from msgspec import Struct
from msgspec.structs import replace

from common.freshness import NS_PER_S
from common.motion import BRAKE, RUN, STOP
from t2.messages import Command, Motion, Phrase, Phrases

STOP_PERIOD_NS = NS_PER_S * 3 // 100  # at the second tick of 20 ms: about 25 Hz
BEGIN_NS = 3 * NS_PER_S  # longer than a restart of safety
AT_ONCE = -STOP_PERIOD_NS  # a send time so old that the next STOP is due


class Refusal(StrEnum):
    """Why a motion message, or its RUN, was refused."""

    SECOND_AUTHORITY = "second_authority"
    OLD = "seq_not_rising"
    LATE = "too_late"
    ESTOP = "estop_not_latched"
    HIT = "hit_not_judged"
    UNCOMMANDED = "uncommanded_motion"
    NOT_LATCH_OWNER = "latch_not_taken_on"
    NOT_READY = "not_ready"
    NOT_NEUTRAL = "waiting_for_neutral"


BRAKING = (Refusal.ESTOP, Refusal.HIT, Refusal.UNCOMMANDED)  # BRAKE, whatever is commanded
WAITING = {
    Refusal.ESTOP: Phrase("waiting.estop"),
    Refusal.HIT: Phrase("waiting.hit"),
    Refusal.UNCOMMANDED: Phrase("waiting.uncommanded"),
    Refusal.NOT_LATCH_OWNER: Phrase("waiting.latch_owner"),
    Refusal.NOT_READY: Phrase("waiting.ready"),
    Refusal.NOT_NEUTRAL: Phrase("waiting.neutral"),
}


class Lease(Struct, frozen=True):
    """The motion authority, its time limit, and the conditions for a RUN."""

    boot: int | None = None  # the authority's
    seq: int = 0  # its newest message
    renewed_ns: int = 0
    over_since_ns: int | None = 0  # None while the lease is valid
    ready: bool = False
    neutral: bool = False
    hit: int | None = None  # ``seq`` of the bumper sample to be acknowledged
    estop: int | None = None  # receive time of the emergency stop to be acknowledged
    sent_ns: int = 0
    # Owner of the latch that was not reset: an authority, or the bridge.
    latched_by: int | None = None
    braked: bool = False  # whether the authority's last order was BRAKE, to this bridge or before
    uncommanded: bool = False  # moved from standstill; safety has not latched it yet

    @property
    def missing(self) -> Refusal | None:
        """The first condition for a RUN that is not met."""
        unmet = {
            Refusal.ESTOP: self.estop is not None,
            Refusal.HIT: self.hit is not None,
            Refusal.UNCOMMANDED: self.uncommanded,
            Refusal.NOT_LATCH_OWNER: self.latched_by not in (None, self.boot),
            Refusal.NOT_READY: not self.ready,
            Refusal.NOT_NEUTRAL: not self.neutral,
        }
        return next((refusal for refusal, missing in unmet.items() if missing), None)

    @property
    def braking(self) -> bool:
        """Whether BRAKE continues, even at standstill."""
        return self.braked or self.missing in BRAKING

    @property
    def waiting(self) -> Phrases:
        """Why a RUN would be refused; empty if it would be obeyed."""
        return (WAITING[self.missing],) if self.missing else ()


def on_motion(
    lease: Lease, motion: Motion, now_ns: int, lease_ns: int, own_boot: int, *, received_ns: int
) -> tuple[Lease, Command | None, Refusal | None]:
    """Check one motion message; return the order to send, if any, and the refusal."""
    if refusal := _refusal(lease, motion, now_ns, lease_ns):
        return lease, None, refusal
    if now_ns - received_ns > lease_ns:
        brake = motion.command is BRAKE
        lease = replace(lease, braked=True) if brake else lease
        return lease, BRAKE if brake else None, Refusal.LATE
    if motion.boot != lease.boot:
        lease = replace(lease, boot=motion.boot)  # its predecessor's expiry cleared ``neutral``
    lease = expire(lease, now_ns, lease_ns)
    lease = replace(lease, seq=motion.seq, renewed_ns=received_ns, over_since_ns=None)
    if motion.judged_boot == own_boot and lease.hit is not None and motion.judged >= lease.hit:
        lease = replace(lease, hit=None)
    if motion.estop == lease.estop:
        lease = replace(lease, estop=None)
    latched_by = _latched_by(lease, motion)
    uncommanded = lease.uncommanded and latched_by == own_boot
    lease = replace(lease, latched_by=latched_by, uncommanded=uncommanded)
    order, refusal = _order(lease, motion)
    # A non-zero RUN is obeyed only if the lease is neutral already.
    neutral = lease.neutral or (lease.ready and refusal is None)
    braked = order is BRAKE
    return replace(lease, neutral=neutral, sent_ns=now_ns, braked=braked), order, refusal


def _refusal(lease: Lease, motion: Motion, now_ns: int, lease_ns: int) -> Refusal | None:
    """Return why a message is ignored: by its sender or ``seq``."""
    if motion.boot == lease.boot:
        return Refusal.OLD if motion.seq <= lease.seq else None
    is_valid = lease.boot is not None and now_ns - lease.renewed_ns <= lease_ns
    return Refusal.SECOND_AUTHORITY if is_valid else None


def is_neutral(motion: Motion) -> bool:
    """Return whether a motion requests standstill."""
    return motion.command is not RUN or (motion.linear == 0 and motion.angular == 0)


def _latched_by(lease: Lease, motion: Motion) -> int | None:
    """Return the owner of the pending latch after this motion of the authority."""
    if not motion.latched:
        return None if lease.latched_by == motion.boot else lease.latched_by
    is_known = lease.latched_by in (None, motion.boot, motion.predecessor)
    return motion.boot if is_known else lease.latched_by


def _order(lease: Lease, motion: Motion) -> tuple[Command, Refusal | None]:
    """Return what is sent for a motion of the authority, and why its RUN is not."""
    missing = lease.missing
    if missing in BRAKING:
        return BRAKE, missing if motion.command is RUN else None
    if motion.command is not RUN:
        return motion.command, None
    if missing is None or (missing is Refusal.NOT_NEUTRAL and is_neutral(motion)):
        return RUN, None
    return STOP, missing


def on_hit(lease: Lease, seq: int, now_ns: int) -> Lease:
    """Hold the BRAKE that was sent for the first sample of a bumper hit: the reflex."""
    return replace(lease, hit=seq, sent_ns=now_ns)


def on_estop(lease: Lease, received_ns: int) -> tuple[Lease, Command | None]:
    """Brake for an emergency stop; another one is the same until safety has latched it.

    While a BRAKE of the authority is valid the board holds it already: a flood of emergency stops
    adds no frames.
    """
    if lease.estop is not None:
        return lease, None
    if lease.braked and lease.over_since_ns is None:
        return replace(lease, estop=received_ns), None
    return replace(lease, estop=received_ns, sent_ns=received_ns), BRAKE


def on_uncommanded(lease: Lease, now_ns: int, own_boot: int) -> tuple[Lease, Command | None]:
    """Latch motion from standstill while the lease is over."""
    if lease.over_since_ns is None or lease.uncommanded:
        return lease, None
    moved = replace(lease, uncommanded=True, latched_by=own_boot, sent_ns=now_ns)
    return moved, BRAKE


def on_ready(lease: Lease, ready: bool) -> Lease:
    """Set whether the board may be driven; losing that clears ``neutral``."""
    if ready == lease.ready:
        return lease
    return replace(lease, ready=ready, neutral=False, sent_ns=lease.sent_ns if ready else AT_ONCE)


def expire(lease: Lease, now_ns: int, lease_ns: int) -> Lease:
    """Record the end of the lease, which clears ``neutral``."""
    if lease.over_since_ns is not None or now_ns - lease.renewed_ns <= lease_ns:
        return lease
    return replace(lease, over_since_ns=now_ns, neutral=False, sent_ns=AT_ONCE)


def on_tick(
    lease: Lease, now_ns: int, lease_ns: int, coast_ns: int, standing: bool
) -> tuple[Lease, Command | None]:
    """Return the order that is due without a motion message."""
    lease = expire(lease, now_ns, lease_ns)
    if lease.over_since_ns is None and lease.ready:
        return lease, None
    if now_ns - lease.sent_ns < STOP_PERIOD_NS:
        return lease, None
    since_ns = lease.over_since_ns
    over_ns = 0 if since_ns is None else now_ns - since_ns
    begins = lease.boot is None and over_ns <= BEGIN_NS
    brake = lease.braking or begins or (over_ns > coast_ns and not standing)
    return replace(lease, sent_ns=now_ns), BRAKE if brake else STOP
