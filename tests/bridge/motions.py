"""Motions and leases that the tests of the lease begin with."""

from msgspec.structs import replace
from msgspec.structs import replace as replace_message

from common.freshness import NS_PER_S
from common.messages import Motion
from common.motion import Command
from services.bridge.lease import Lease, on_motion

MS = NS_PER_S // 1000
LEASE = 200 * MS
COAST = 1000 * MS
OWN_BOOT = 7
NOW = 100 * NS_PER_S

ARMED = Lease(boot=1, seq=10, renewed_ns=NOW, over_since_ns=None, ready=True, neutral=True)
HIT = replace(ARMED, hit=5)
STOPPED = replace(ARMED, estop=NOW)
MOVED = replace(ARMED, uncommanded=True, latched_by=OWN_BOOT)
OWED = replace(ARMED, latched_by=3)  # by one that has ended


def run(
    linear: float = 0.5,
    angular: float = 0.0,
    *,
    seq: int = 11,
    boot: int = 1,
    judged: int = 0,
    judged_boot: int = 0,
    estop: int | None = None,
) -> Motion:
    return Motion(
        command=Command.RUN,
        linear=linear,
        angular=angular,
        seq=seq,
        boot=boot,
        judged=judged,
        judged_boot=judged_boot,
        estop=estop,
    )


def stop(seq: int = 11, boot: int = 1) -> Motion:
    return Motion(command=Command.STOP, seq=seq, boot=boot)


def brake(seq: int = 11, boot: int = 1) -> Motion:
    return Motion(command=Command.BRAKE, seq=seq, boot=boot)


def taking_on(motion: Motion, predecessor: int | None) -> Motion:
    """Return it from a sender that has latched, and knows of this one before it."""
    return replace_message(motion, latched=True, predecessor=predecessor)


def obey(lease: Lease, motion: Motion, now_ns: int = NOW) -> tuple[Lease, Command | None, object]:
    return on_motion(lease, motion, now_ns, LEASE, OWN_BOOT, received_ns=now_ns)
