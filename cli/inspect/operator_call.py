"""What ``t2 call`` takes from safety's state for an operator's call, and whether it had effect."""

import sys
from collections.abc import Iterator
from typing import Any

from common import codec, keys
from common.bus.probe import Answer, Probe
from common.errors import MessageError
from common.keys import Call
from common.messages import ReleaseRequest, ResetDone, SafetyState
from common.operator import CONFIRM_S, confirms, reset_request

SEEN_S = 1.0  # for a state of safety to arrive; there are 20 a second
NO_STATE = (
    "no state of safety within 1 s, and the call needs its heartbeat: is safety running? "
    "run `t2 doctor`"
)

Request = dict[str, Any]


def wants_state(call: Call[Any, Any] | None, request: Request) -> bool:
    """Return whether a call needs safety's newest state; the end of a release does not."""
    if call is None or "echo" not in call.request.__struct_fields__:
        return False
    if call.request is ReleaseRequest and request.get("held") is False:
        return False
    return call is keys.RESET or request.get("echo") is None


def newest(probe: Probe, robot: str) -> SafetyState | None:
    """Return the next state that safety publishes; None without one."""
    probe.listen(keys.SAFETY.on(robot))
    return next(_states(probe, SEEN_S), None)


def filled(call: Call[Any, Any], request: Request, seen: SafetyState) -> Request:
    """Return the request with defaults filled in; for a reset, print the causes it clears."""
    known = {name: value for name, value in request.items() if value is not None}
    if call is keys.RESET and "causes" not in known:
        known["causes"] = list(reset_request(seen).causes)
        for cause in seen.causes:
            if cause.id in known["causes"]:
                print(f"t2 call: clears {cause.name}: {cause.text}", file=sys.stderr)
    return {"echo": seen.heartbeat, **known}


def confirmed(probe: Probe, seen: SafetyState, answers: list[Answer]) -> bool:
    """Return whether safety's state soon shows what one of the answers to a reset claims."""
    done = list(_claims(answers))
    return bool(done) and any(
        confirms(seen, claim, state) for state in _states(probe, CONFIRM_S) for claim in done
    )


def _states(probe: Probe, seconds: float) -> Iterator[SafetyState]:
    for heard in probe.samples(seconds):
        try:
            yield codec.decode(heard.payload, SafetyState)
        except MessageError:
            continue  # of another service


def _claims(answers: list[Answer]) -> Iterator[ResetDone]:
    for answer in answers:
        try:
            yield codec.decode(answer.payload, ResetDone)
        except MessageError:
            continue
