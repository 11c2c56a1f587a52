"""The first missing part, and the causes that follow from it."""

import pytest

from common.root_cause import FROM_LINK, Part, RootCause, root_cause
from services.safety.core.causes import BY_NAME, Clears
from t2.messages import Cause, CauseName, Link, Relay, SafetyState
from tests.factories import link, safety_state


def state(*names: CauseName) -> SafetyState:
    causes = tuple(Cause(name=name, action="stop", age=1.0, text=name) for name in names)
    return safety_state(causes=causes)


RELAY = Relay(state="lost", version="", braking="", uptime=0.0, counters={})
LACKING = state("contact", "bumper", "silent", "no_request")
FOLDED = ("bumper", "silent")


@pytest.mark.parametrize(
    ("connected", "safety", "known", "part", "folded"),
    [
        (False, None, None, "router", ()),
        (True, None, link(state="lost"), "safety", ()),
        (True, LACKING, None, "bridge", FOLDED),
        (True, state("sonar", "obstacle"), None, "", ()),  # the vehicle drives
        (True, state("no_request"), None, "", ()),  # lost on the way to this screen only
        (True, LACKING, link(state="lost", relay=RELAY), "relay", FOLDED),
        (True, LACKING, link(state="never"), "board", FOLDED),
        (True, LACKING, link(), "", ()),  # a sensor: safety names it
    ],
)
def test_the_first_missing_part_and_what_follows(
    connected: bool, safety: SafetyState | None, known: Link | None, part: Part,
    folded: tuple[CauseName, ...],
) -> None:  # fmt: skip
    assert root_cause(connected, safety, known) == RootCause(part, folded)


def test_no_latch_and_no_brake_is_folded() -> None:
    for name in FROM_LINK:
        assert BY_NAME[name].clears is not Clears.RESET
        assert BY_NAME[name].action != "brake"
