"""Held causes: since when each is held, and what a reset may clear.

A cause is observed with a *token*, the identity of the sample that shows it. Good samples are
counted by token, so one sample counts once.

Each occurrence of a cause has an *identity*, made of the decision in which it began and the cause's
row. A cause that returns after ``GOOD_SAMPLES`` samples without it is a new occurrence. An
operator's reset names the identities that the operator saw, and clears only these.

Some causes clear by themselves. ``FaultBudget`` limits how often: each failure costs one point, and
good time refills the budget slowly. Inputs that fail repeatedly exhaust it and latch.
"""

from collections.abc import Container, Iterable, Mapping

from msgspec import Struct
from msgspec.structs import replace

from common.freshness import NS_PER_S
from services.safety.causes import BY_NAME, RULES, Clears, clears, severity

Token = tuple[int, int]  # boot and seq of a sample; (0, time) without a sample

GOOD_SAMPLES = 3  # samples without the cause before a reset may clear it
FAILURES = 5.0  # failures in short succession that exhaust the budget
REFILL_PER_S = 0.1  # ten good seconds refill one failure
_ROW = {rule.name: row for row, rule in enumerate(RULES)}


class Observation(Struct, frozen=True):
    """Whether a sample shows a cause, with a text for the operator."""

    name: str
    present: bool
    token: Token
    text: str = ""


class Held(Struct, frozen=True):
    """State of a held cause."""

    since_ns: int  # when this occurrence began
    bad_ns: int  # last observation of the cause
    good: int  # samples without it since then
    token: Token
    text: str
    id: int = 0  # of this occurrence


Latches = Mapping[str, Held]


def observe(
    held: Latches, seen: Iterable[Observation], now_ns: int, settle_ns: int = 0, decision: int = 0
) -> dict[str, Held]:
    """Return the held causes after these observations; unobserved causes stay held.

    ``settle_ns`` applies to causes that clear by ``SETTLED``. ``decision`` is the number of this
    decision. A decision observes each cause once, so identities are unique.
    """
    result = dict(held)
    for one in seen:
        old = held.get(one.name)
        if one.present:
            text = one.text or BY_NAME[one.name].text
            since_ns, id_ = now_ns, decision * len(RULES) + _ROW[one.name]
            if old and old.good < GOOD_SAMPLES:
                since_ns, id_ = old.since_ns, old.id
            result[one.name] = Held(since_ns, now_ns, 0, one.token, text, id_)
        elif old and _is_over(one.name, old, now_ns, settle_ns):
            del result[one.name]
        elif old:
            good = old.good + (one.token != old.token)
            result[one.name] = replace(old, good=good, token=one.token)
    return result


def _is_over(name: str, old: Held, now_ns: int, settle_ns: int) -> bool:
    how = clears(name)
    if how is Clears.SETTLED:
        return now_ns - old.bad_ns >= settle_ns
    return how is not Clears.RESET


def latched(held: Latches) -> tuple[str, ...]:
    """Return the names of the causes that require a reset, worst first."""
    return ordered(name for name in held if clears(name) is Clears.RESET)


def ordered(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names, worst first."""
    return tuple(sorted(names, key=severity))


def still_present(held: Latches) -> tuple[str, ...]:
    """Return the names of the latched causes that are still present, worst first."""
    return tuple(name for name in latched(held) if held[name].good < GOOD_SAMPLES)


def begun(held: Latches, decision: int) -> tuple[str, ...]:
    """Return the names of the latched causes that began in this decision, worst first."""
    return tuple(name for name in latched(held) if held[name].id // len(RULES) == decision)


def named(held: Latches, ids: Container[int]) -> tuple[str, ...]:
    """Return the names of the latched causes with these identities, worst first."""
    return tuple(name for name in latched(held) if held[name].id in ids)


def reset(held: Latches, ids: Container[int]) -> dict[str, Held]:
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
