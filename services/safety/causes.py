"""Table of causes that stop or slow the vehicle; this table is the specification.

Every decision observes every cause again. The worst action of the held causes applies. A cause is
held from the observation that raises it until it clears by its own rule:

========== ===================================================================================
clears     when
========== ===================================================================================
RESET      an operator's reset, once 3 samples do not show the cause, the vehicle stands and no
           source requests motion; then a neutral request (one exception: ``operator_requests.py``)
SETTLED    by itself 0.5 s after the last observation; then a neutral request
NEUTRAL    by itself with the first observation without it; then a neutral request
AT_ONCE    by itself with the first observation without it (the observer has the hysteresis)
========== ===================================================================================

Two things are not causes. A refused request is counted and changes nothing. Limits of speed and
acceleration change a request without being reported.
"""

from enum import Enum

from msgspec import Struct

from common.messages import Action

SEVERITY: dict[Action, int] = {"slow": 1, "stop": 2, "brake": 3}


class Clears(Enum):
    """Rule by which a cause clears."""

    RESET = "reset"
    SETTLED = "settled"
    NEUTRAL = "neutral"
    AT_ONCE = "at once"


class Rule(Struct, frozen=True):
    """One row: the action of a cause, how it clears, and its text for the operator."""

    name: str
    action: Action
    clears: Clears
    text: str


RULES = (
    # latched
    Rule("contact", "brake", Clears.RESET, "The bumper was hit."),
    Rule("estop", "brake", Clears.RESET, "Emergency stop."),
    Rule("estop_reader", "brake", Clears.RESET, "The emergency stop cannot be received."),
    Rule(
        "estop_keepalive", "brake", Clears.RESET, "The emergency stop is no longer kept alive.",
    ),
    Rule("predecessor", "brake", Clears.RESET, "Safety restarted while a reset was due."),
    Rule("runaway", "brake", Clears.RESET, "The vehicle did not move as commanded."),
    Rule(
        "uncommanded_motion", "brake", Clears.RESET,
        "The vehicle moved while standstill was commanded.",
    ),
    # the only BRAKE that clears by itself
    Rule("not_stopping", "brake", Clears.SETTLED, "The vehicle does not stop."),
    # latched
    Rule("driver_left", "stop", Clears.RESET, "The left motor driver reported a fault."),
    Rule("driver_right", "stop", Clears.RESET, "The right motor driver reported a fault."),
    Rule("flapping", "stop", Clears.RESET, "Inputs failed repeatedly."),
    # inhibiting
    Rule("leaving", "stop", Clears.SETTLED, "The safety service is shutting down."),
    Rule("starting", "stop", Clears.SETTLED, "Waiting for the first samples."),
    Rule("link", "stop", Clears.SETTLED, "The link to the board is down."),
    Rule("switches", "stop", Clears.SETTLED, "The board's emergency brakes are not verified."),
    Rule("bumper", "stop", Clears.SETTLED, "The bumper is not being read."),
    Rule("silent", "stop", Clears.SETTLED, "An input is too old."),
    Rule("unarmed", "stop", Clears.SETTLED, "The bridge is not armed yet."),
    # by third parties
    Rule("limit_stop", "stop", Clears.NEUTRAL, "A limit source stops the vehicle."),
    Rule("limit_silent", "stop", Clears.NEUTRAL, "A limit source is silent."),
    # transient
    Rule("two_publishers", "stop", Clears.AT_ONCE, "Two publishers use one source."),
    Rule(
        "neutral", "stop", Clears.AT_ONCE,
        "Waiting for a neutral request: release the controls, then drive.",
    ),
    Rule("blocked", "stop", Clears.AT_ONCE, "No room in that direction."),
    Rule("no_request", "stop", Clears.AT_ONCE, "No source requests motion."),
    Rule("release", "slow", Clears.AT_ONCE, "Creeping off the bumper."),
    Rule("bumper_lossy", "slow", Clears.AT_ONCE, "Creeping: bumper polls were lost."),
    Rule("limit", "slow", Clears.AT_ONCE, "Slowed by a limit source."),
    Rule("obstacle", "slow", Clears.AT_ONCE, "Slowed by an obstacle."),
    Rule("sonar", "slow", Clears.AT_ONCE, "A sonar cannot be trusted."),
)  # fmt: skip

BY_NAME = {rule.name: rule for rule in RULES}
_ORDER = {rule.name: (-SEVERITY[rule.action], row) for row, rule in enumerate(RULES)}


def severity(name: str) -> tuple[int, int]:
    """Return a sort key: worst first, ties in table order."""
    return _ORDER[name]


def clears(name: str) -> Clears:
    """Return how a cause clears."""
    return BY_NAME[name].clears


def wants_neutral(name: str) -> bool:
    """Return whether a neutral request is required once the cause has cleared."""
    return clears(name) is not Clears.AT_ONCE


def bars_motion(name: str) -> bool:
    """Return whether the cause forbids every motion."""
    return name in BARRING


BARRING = frozenset(
    rule.name for rule in RULES if wants_neutral(rule.name) or rule.name == "two_publishers"
)
