"""Why the vehicle may not move as asked: the table, which is the specification.

Every decision observes every cause anew. The worst action of those that are held wins. A cause is
held from the observation that raises it until it clears in its own way:

========== ===================================================================================
clears     when
========== ===================================================================================
RESET      an operator's reset, once the cause is gone for 3 samples, the vehicle stands and
           nobody asks to move; then a neutral request (one exception, see ``operator_requests.py``)
SETTLED    by itself after it was gone for 0.5 s; then a neutral request
AT_ONCE    by itself with the observation that no longer shows it (hysteresis is in the observer)
========== ===================================================================================

Two things are no causes: a request that is refused is counted and changes nothing, and a limit of
speed or acceleration bends a request without a word.
"""

from enum import Enum

from msgspec import Struct

from common.messages import Action

SEVERITY: dict[Action, int] = {"slow": 1, "stop": 2, "brake": 3}


class Clears(Enum):
    """How a cause goes away."""

    RESET = "reset"
    SETTLED = "settled"
    AT_ONCE = "at once"


class Rule(Struct, frozen=True):
    """One row: what a cause does and how it clears; ``text`` tells the operator."""

    name: str
    action: Action
    clears: Clears
    text: str


RULES = (
    # latched
    Rule("contact", "brake", Clears.RESET, "The bumper was hit."),
    Rule("estop", "brake", Clears.RESET, "Emergency stop."),
    Rule("estop_reader", "brake", Clears.RESET, "The emergency stop could not be heard."),
    Rule("predecessor", "brake", Clears.RESET, "Safety started anew with a reset still due."),
    Rule("runaway", "brake", Clears.RESET, "The vehicle did not move as commanded."),
    Rule(
        "uncommanded_motion", "brake", Clears.RESET,
        "The vehicle moved while standstill was commanded.",
    ),
    # the only brake that clears by itself
    Rule("not_stopping", "brake", Clears.SETTLED, "The vehicle does not stop."),
    # latched
    Rule("driver_left", "stop", Clears.RESET, "The left motor driver reported a fault."),
    Rule("driver_right", "stop", Clears.RESET, "The right motor driver reported a fault."),
    Rule("flapping", "stop", Clears.RESET, "Inputs failed again and again."),
    # inhibiting
    Rule("leaving", "stop", Clears.SETTLED, "The safety service is shutting down."),
    Rule("starting", "stop", Clears.SETTLED, "Waiting for the first samples."),
    Rule("link", "stop", Clears.SETTLED, "The link to the board is down."),
    Rule("switches", "stop", Clears.SETTLED, "The board's emergency brakes are not verified."),
    Rule("bumper", "stop", Clears.SETTLED, "The bumper is not being read."),
    Rule("silent", "stop", Clears.SETTLED, "An input is too old."),
    Rule("unarmed", "stop", Clears.SETTLED, "The bridge does not obey yet."),
    # passing
    Rule("two_publishers", "stop", Clears.AT_ONCE, "Two publishers ask on one source."),
    Rule(
        "neutral", "stop", Clears.AT_ONCE,
        "Waiting for a neutral request: release the controls, then drive.",
    ),
    Rule("blocked", "stop", Clears.AT_ONCE, "There is no room that way."),
    Rule("no_request", "stop", Clears.AT_ONCE, "Nobody asks to move."),
    Rule("release", "slow", Clears.AT_ONCE, "Creeping off the bumper."),
    Rule("bumper_lossy", "slow", Clears.AT_ONCE, "Creeping: bumper polls were lost."),
    Rule("obstacle", "slow", Clears.AT_ONCE, "Slowed by an obstacle."),
    Rule("sonar", "slow", Clears.AT_ONCE, "A sonar cannot be trusted."),
)  # fmt: skip

BY_NAME = {rule.name: rule for rule in RULES}
_ORDER = {rule.name: (-SEVERITY[rule.action], row) for row, rule in enumerate(RULES)}


def severity(name: str) -> tuple[int, int]:
    """Return a sort key: the worst first, ties in the order of the table."""
    return _ORDER[name]


def clears(name: str) -> Clears:
    """Return how a cause goes away."""
    return BY_NAME[name].clears


def wants_neutral(name: str) -> bool:
    """Tell whether a neutral request must follow once the cause is gone."""
    return clears(name) is not Clears.AT_ONCE


def bars_motion(name: str) -> bool:
    """Return whether it bars motion, whatever is requested."""
    return wants_neutral(name) or name == "two_publishers"
