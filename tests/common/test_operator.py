"""What an operator's calls carry, and when the answer to a reset is believed."""

from msgspec.structs import replace

from common.messages import Cause, Limits, ResetDone, SafetyState
from common.operator import (
    AHEAD,
    MAX_CALL_AGE_NS,
    Echoes,
    confirms,
    release_request,
    reset_request,
)

CONTACT = Cause(name="contact", action="brake", age=1.0, text="", id=41)
ESTOP = Cause(name="estop", action="brake", age=1.0, text="", id=42)
IDLE = Cause(name="no_request", action="stop", age=1.0, text="", id=40)
SEEN = SafetyState(
    verdict="brake", latched=("contact", "estop"), causes=(CONTACT, ESTOP, IDLE), source=None,
    limits=Limits(forward=0, backward=0, angular=0), heartbeat=7, text="", boot=3,
)  # fmt: skip
DONE = ResetDone(text="", boot=3, heartbeat=9, cleared=(41, 42))
AFTER = replace(SEEN, heartbeat=9, latched=(), causes=(IDLE,))


def test_a_reset_names_the_latched_causes_that_were_seen() -> None:
    request = reset_request(SEEN)
    assert (request.echo, request.causes) == (7, (41, 42))


def test_a_release_carries_the_direction_and_the_echo() -> None:
    request = release_request(SEEN, "backward", held=True)
    assert (request.held, request.direction, request.echo) == (True, "backward", 7)
    assert release_request(None, None, held=False).echo is None


def test_a_reset_is_confirmed_by_the_state_alone() -> None:
    assert confirms(SEEN, DONE, AFTER)
    assert not confirms(SEEN, DONE, SEEN)  # older than the effect
    assert not confirms(SEEN, DONE, replace(AFTER, causes=(ESTOP,)))  # one is left
    assert confirms(SEEN, replace(DONE, cleared=(42,)), AFTER)
    assert not confirms(SEEN, replace(DONE, boot=4), AFTER)  # somebody else answered
    assert not confirms(SEEN, replace(DONE, cleared=()), AFTER)  # and claims nothing
    assert not confirms(SEEN, replace(DONE, cleared=(40,)), AFTER)  # or what was not latched
    assert not confirms(SEEN, replace(DONE, cleared=(41, 99)), AFTER)  # or what was not there
    assert not confirms(SEEN, DONE, replace(AFTER, boot=4))  # another safety service by now


def test_echoes_are_known_by_when_their_state_came() -> None:
    echoes = Echoes()
    assert "no echo" in echoes.refusal(None, 0)
    assert "unknown" in echoes.refusal(7, 0)
    echoes = echoes.received(SEEN, 100)
    assert echoes.refusal(7, 100 + MAX_CALL_AGE_NS) == ""
    assert "allowed is 1 s" in echoes.refusal(7, 101 + MAX_CALL_AGE_NS)
    assert "unknown" in echoes.refusal(6, 100)
    newer = echoes.received(replace(SEEN, heartbeat=8), 100 + MAX_CALL_AGE_NS)
    assert "allowed is 1 s" in newer.refusal(7, 101 + MAX_CALL_AGE_NS)
    assert newer.refusal(8, 101 + MAX_CALL_AGE_NS) == ""


def test_another_start_of_safety_makes_old_echoes_unknown() -> None:
    echoes = Echoes().received(SEEN, 100).received(replace(SEEN, boot=4, heartbeat=900), 200)
    assert "unknown" in echoes.refusal(7, 200)
    assert echoes.refusal(900, 200) == ""


def test_an_echo_may_be_slightly_ahead_of_what_came() -> None:
    echoes = Echoes().received(SEEN, 100)
    assert echoes.refusal(7 + AHEAD, 100) == ""
    assert "unknown" in echoes.refusal(8 + AHEAD, 100)
    assert "allowed is 1 s" in echoes.refusal(8, 101 + MAX_CALL_AGE_NS)  # safety has fallen silent
