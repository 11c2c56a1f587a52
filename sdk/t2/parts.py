"""Parts of messages; generated from the stack by ``make docs``, do not edit."""

from typing import Annotated, Literal

from msgspec import Meta, Struct

Action = Literal["slow", "stop", "brake"]
Direction = Literal["forward", "backward"]
ReleaseRequest = Literal["none", "forward", "backward"]  # off a pressed bumper
LimitEffect = Literal["none", "slow", "stop"]

# A longer text or list makes a message undecodable. Members that may only read publish events, too:
# one of 1 MB delayed the emergency stop of a terminal by seconds.
MAX_TEXT = 4000
Text = Annotated[str, Meta(max_length=MAX_TEXT)]
Name = Annotated[str, Meta(max_length=200)]
Few = Meta(max_length=128)
Counts = Annotated[dict[Name, int], Few]


class Cause(Struct, frozen=True, kw_only=True):
    """One reason why the vehicle may not move as asked."""

    name: Name
    action: Action
    age: float  # s since it became active
    text: Text  # text for the operator
    id: int = 0  # this occurrence, see ``ResetRequest.causes``; a new one for each occurrence


class Limits(Struct, frozen=True, kw_only=True):
    """What a drive request may reach now; zero while a cause forbids every motion.

    A release has its own speed, ``safety.release_speed``.
    """

    forward: float  # m/s
    backward: float  # m/s, as a positive number
    angular: float  # rad/s, either way


class Release(Struct, frozen=True, kw_only=True):
    """State of moving off a pressed bumper; the operator chooses the direction."""

    believed_free: Direction | None  # opposite of the last motion; None when none is known
    travelled: float  # m, net travel by the counters over the last metre before the contact
    age: float | None  # s since that motion; None when none is known
    forbidden: Annotated[tuple[Direction, ...], Few]  # until a reset: it was pressed that way
    left: float  # m that may still be travelled until a reset


class LimitState(Struct, frozen=True, kw_only=True):
    """State of one source of speed limits, see ``Limit``."""

    source: Name
    linear: float | None  # m/s; None: no cap
    angular: float | None  # rad/s, likewise
    reason: Text  # in the source's words
    age: float | None  # s since its last limit; None: none was received
    silent: bool  # whether its lease is over, or it was never received
    effect: LimitEffect  # on the vehicle now


class KeepaliveState(Struct, frozen=True, kw_only=True):
    """State of an emergency stop that must be kept alive, see ``EstopKeepalive``."""

    source: Name
    age: float | None  # s since safety sent the newest heartbeat that it echoed; None: not received
    alive: bool
    timeout: float  # s; older, and safety brakes and latches
