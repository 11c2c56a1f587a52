"""Operator calls: built from the safety state that the operator saw, and checked for effect."""

from msgspec import Struct

from common.freshness import NS_PER_S
from common.heartbeat import Heartbeat
from common.messages import Direction, ReleaseRequest, ResetDone, ResetRequest, SafetyState

CONFIRM_S = 1.0  # from a reset's answer to the state that shows its effect
MAX_CALL_AGE_NS = NS_PER_S  # of a call to odometry or the bridge; safety has a setting
AHEAD = 20  # heartbeats (1 s) that a call may be ahead of the newest one received here


class Echoes(Struct, frozen=True):
    """Heartbeats of the running safety service, as another service received them."""

    boot: int = 0
    heartbeat: Heartbeat = Heartbeat()

    def received(self, state: SafetyState, now_ns: int) -> "Echoes":
        """Return the echoes with a state; those of an earlier start of safety are discarded."""
        heartbeat = self.heartbeat if state.boot == self.boot else Heartbeat()
        return Echoes(state.boot, heartbeat.noted(state.heartbeat, now_ns))

    def refusal(self, echo: int | None, now_ns: int) -> str:
        """Return why a call with this echo is refused, for a person; empty if not.

        A state may reach the operator's program before it comes here: an echo slightly ahead
        counts as the newest number, and is as old as that.
        """
        newest = self.heartbeat.number
        if echo is not None and newest < echo <= newest + AHEAD:
            echo = newest
        return self.heartbeat.refusal(echo, now_ns, MAX_CALL_AGE_NS)


def reset_request(seen: SafetyState) -> ResetRequest:
    """Return the request to clear exactly the latched causes of this state."""
    latched = tuple(cause.id for cause in seen.causes if cause.name in seen.latched)
    return ResetRequest(echo=seen.heartbeat, causes=latched)


def release_request(
    seen: SafetyState | None, direction: Direction | None, *, held: bool
) -> ReleaseRequest:
    """Return the request to move off the bumper in a direction, or to end that."""
    echo = seen.heartbeat if seen else None
    return ReleaseRequest(held=held, direction=direction, echo=echo)


def confirms(seen: SafetyState, done: ResetDone, state: SafetyState) -> bool:
    """Return whether ``state`` shows the effect of the reset that ``done`` claims.

    ``seen`` is the state that the request was built from. The answer must come from the safety
    service that publishes the state, it must name causes that were latched in ``seen``, and none of
    those may be left. A program that gets no such state within ``CONFIRM_S`` reports "not
    confirmed".
    """
    if not done.boot == seen.boot == state.boot or state.heartbeat < done.heartbeat:
        return False
    cleared, named = set(done.cleared), set(reset_request(seen).causes)
    return bool(cleared) and cleared <= named and not {one.id for one in state.causes} & cleared
