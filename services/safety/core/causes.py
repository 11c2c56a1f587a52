"""Table of causes that stop or slow the vehicle; this table is the specification.

Every decision observes every cause again. The worst action of the held causes applies. A cause is
held from the observation that shows it until it clears by its own rule:

========== ===================================================================================
clears     when
========== ===================================================================================
RESET      an operator's reset, once 3 samples do not show the cause, the vehicle stands and no
           source requests motion; then a neutral request (one exception: ``release_requests.py``)
SETTLED    by itself 0.5 s after the last observation; then a neutral request
NEUTRAL    by itself with the first observation without it; then a neutral request
AT_ONCE    by itself with the first observation without it (the observer has the hysteresis)
========== ===================================================================================

Two things are not causes. A refused request is counted and changes nothing. Limits of speed and
acceleration change a request without being reported.

**Held causes.** Some causes are shown by a sample of one stream. Its *token*, the identity of the
sample, is kept, so that one good sample counts once. All others are observed anew in each decision.

Each occurrence of a cause has an *identity*, made of the decision in which it began and the cause's
row. A cause that returns after ``GOOD_SAMPLES`` samples without it is a new occurrence. An
operator's reset names the identities that the operator saw, and clears only these.

Some causes clear by themselves. ``FaultBudget`` limits how often: each failure costs one point, and
good time refills the budget slowly. Inputs that fail repeatedly exhaust it and latch.
"""

from collections.abc import Container, Iterable, Mapping
from enum import Enum

from msgspec import Struct
from msgspec.structs import replace

from common.freshness import NS_PER_S
from t2.messages import Action, CauseName, Phrase, Phrases


class Clears(Enum):
    """Rule by which a cause clears."""

    RESET = "reset"
    SETTLED = "settled"
    NEUTRAL = "neutral"
    AT_ONCE = "at once"


class Rule(Struct, frozen=True):
    """One row: the action of a cause, and how it clears. Its texts are in ``t2.catalogue``."""

    name: CauseName
    action: Action
    clears: Clears


RULES = (
    # latched
    Rule("contact", "brake", Clears.RESET),
    Rule("estop", "brake", Clears.RESET),
    Rule("estop_reader", "brake", Clears.RESET),
    Rule("estop_keepalive", "brake", Clears.RESET),
    Rule("predecessor", "brake", Clears.RESET),
    Rule("runaway", "brake", Clears.RESET),
    Rule("uncommanded_motion", "brake", Clears.RESET),
    # the only BRAKE that clears by itself
    Rule("not_stopping", "brake", Clears.SETTLED),
    # latched
    Rule("driver_left", "stop", Clears.RESET),
    Rule("driver_right", "stop", Clears.RESET),
    Rule("flapping", "stop", Clears.RESET),
    # inhibiting
    Rule("leaving", "stop", Clears.SETTLED),
    Rule("starting", "stop", Clears.SETTLED),
    Rule("link", "stop", Clears.SETTLED),
    Rule("switches", "stop", Clears.SETTLED),
    Rule("bumper", "stop", Clears.SETTLED),
    Rule("silent", "stop", Clears.SETTLED),
    Rule("unarmed", "stop", Clears.SETTLED),
    # by third parties
    Rule("limit_stop", "stop", Clears.NEUTRAL),
    Rule("limit_silent", "stop", Clears.NEUTRAL),
    Rule("two_publishers", "stop", Clears.NEUTRAL),
    # transient
    Rule("neutral", "stop", Clears.AT_ONCE),
    Rule("blocked", "stop", Clears.AT_ONCE),
    Rule("no_request", "stop", Clears.AT_ONCE),
    Rule("release", "slow", Clears.AT_ONCE),
    Rule("limit", "slow", Clears.AT_ONCE),
    Rule("obstacle", "slow", Clears.AT_ONCE),
    Rule("sonar", "slow", Clears.AT_ONCE),
)

BY_NAME = {rule.name: rule for rule in RULES}
_ROW = {rule.name: row for row, rule in enumerate(RULES)}  # the worst first


def clears(name: CauseName) -> Clears:
    """Return how a cause clears."""
    return BY_NAME[name].clears


# Causes that forbid every motion; once all have cleared, a neutral request is due.
BARRING = frozenset(rule.name for rule in RULES if rule.clears is not Clears.AT_ONCE)
# Causes that depend on what a source requests.
OF_REQUESTS = BY_NAME.keys() - BARRING
FLAPPING: frozenset[CauseName] = frozenset({"flapping"})  # depends on the other causes of inputs
OF_INPUTS = BARRING - FLAPPING
LATCHING = frozenset(rule.name for rule in RULES if rule.clears is Clears.RESET)
SETTLING = frozenset(rule.name for rule in RULES if rule.clears is Clears.SETTLED)
# An input fails; a vehicle that rolls down a slope is not an input.
FAILING = SETTLING - {"not_stopping"}


Token = tuple[int, int]  # boot and seq of a sample; (0, time) without a sample

GOOD_SAMPLES = 3  # samples without the cause before a reset may clear it
FAILURES = 5.0  # failures in short succession that exhaust the budget
REFILL_PER_S = 0.1  # ten good seconds refill one failure


class Observation(Struct, frozen=True):
    """A cause that is shown; ``phrases`` describe it, without any its name does."""

    name: CauseName
    phrases: Phrases = ()


class Held(Struct, frozen=True):
    """State of a held cause."""

    since_ns: int  # when this occurrence began
    bad_ns: int  # last observation of the cause
    good: int  # samples without it since then
    token: Token
    phrases: Phrases
    id: int = 0  # of this occurrence


Latches = Mapping[CauseName, Held]


def observe(
    held: Latches,
    seen: Iterable[Observation],
    among: Container[CauseName],
    now_ns: int,
    *,
    decision: int,
    samples: Mapping[CauseName, Token] = {},
    settle_ns: int = 0,
) -> dict[CauseName, Held]:
    """Return the held causes after an observation of those ``among`` all; the others stay held.

    ``samples`` are the tokens of causes that a sample shows, ``settle_ns`` applies to causes that
    clear by ``SETTLED``, ``decision`` is the number of this decision. A decision observes each
    cause once, so identities are unique.
    """
    shown = {one.name: one.phrases or (Phrase(one.name),) for one in seen}
    result = dict(held)
    for name, old in held.items():
        if name not in among or name in shown:
            continue
        if _is_over(name, old, now_ns, settle_ns):
            del result[name]
        else:
            token = samples.get(name, (0, now_ns))
            result[name] = replace(old, good=old.good + (token != old.token), token=token)
    for name, phrases in shown.items():
        since_ns, id_ = now_ns, decision * len(RULES) + _ROW[name]
        before = held.get(name)
        if before and before.good < GOOD_SAMPLES:
            since_ns, id_ = before.since_ns, before.id
        token = samples.get(name, (0, now_ns))
        result[name] = Held(since_ns, now_ns, 0, token, phrases, id_)
    return result


def _is_over(name: CauseName, old: Held, now_ns: int, settle_ns: int) -> bool:
    how = clears(name)
    if how is Clears.SETTLED:
        return now_ns - old.bad_ns >= settle_ns
    return how is not Clears.RESET


def latched(held: Latches) -> tuple[CauseName, ...]:
    """Return the names of the causes that require a reset, worst first."""
    return ordered(LATCHING & held.keys())


def needs_reset(held: Latches) -> bool:
    """Return whether any cause requires a reset."""
    return not LATCHING.isdisjoint(held)


def ordered(names: Iterable[CauseName]) -> tuple[CauseName, ...]:
    """Return the names, worst first."""
    return tuple(sorted(names, key=_ROW.__getitem__))


def still_present(held: Latches) -> tuple[CauseName, ...]:
    """Return the names of the latched causes that are still present, worst first."""
    return tuple(name for name in latched(held) if held[name].good < GOOD_SAMPLES)


def begun(held: Latches, decision: int) -> tuple[CauseName, ...]:
    """Return the names of the latched causes that began in this decision, worst first."""
    return tuple(name for name in latched(held) if held[name].id // len(RULES) == decision)


def named(held: Latches, ids: Container[int]) -> tuple[CauseName, ...]:
    """Return the names of the latched causes with these identities, worst first."""
    return tuple(name for name in latched(held) if held[name].id in ids)


def reset(held: Latches, ids: Container[int]) -> dict[CauseName, Held]:
    """Return the held causes after clearing these identities, except those still present."""
    cleared = set(named(held, ids)).difference(still_present(held))
    return {name: one for name, one in held.items() if name not in cleared}


class FaultBudget(Struct, frozen=True):
    """Remaining failures that may clear by themselves."""

    remaining: float = FAILURES
    updated_ns: int = 0

    @property
    def is_spent(self) -> bool:
        """Whether the budget is exhausted."""
        return self.remaining <= 0

    def updated(self, now_ns: int, failed: bool, good: bool) -> "FaultBudget":
        """Return the budget now; ``failed``: inputs have just changed from good to bad."""
        elapsed_s = (now_ns - self.updated_ns) / NS_PER_S
        refill = REFILL_PER_S * elapsed_s if good and self.updated_ns else 0.0
        return FaultBudget(max(0.0, min(FAILURES, self.remaining + refill) - failed), now_ns)
