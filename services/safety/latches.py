"""Which causes are held, since when, and what a reset may clear.

A cause is observed with a *token*, the identity of the sample that shows it. Good samples are
counted by tokens, so that looking twice at one sample proves nothing twice.

Each occurrence of a cause has an *identity*, made of the decision in which it began and the cause's
row. A cause that comes back after ``GOOD_SAMPLES`` without it is a new occurrence. An operator's
reset names the identities that the operator saw, and clears no others.
"""

from collections.abc import Container, Iterable, Mapping

from msgspec import Struct
from msgspec.structs import replace

from services.safety.causes import BY_NAME, RULES, Clears, clears, severity

Token = tuple[int, int]  # boot and seq of a sample, or (0, time) where there is none

GOOD_SAMPLES = 3  # so many without the cause before a reset may clear it
_ROW = {rule.name: row for row, rule in enumerate(RULES)}


class Observation(Struct, frozen=True):
    """Whether a sample shows a cause, and what to tell the operator."""

    name: str
    present: bool
    token: Token
    text: str = ""


class Held(Struct, frozen=True):
    """A cause that is in force."""

    since_ns: int  # when this occurrence began
    bad_ns: int  # when it was last seen
    good: int  # samples without it since
    token: Token
    text: str
    id: int = 0  # of this occurrence


Latches = Mapping[str, Held]


def observe(
    held: Latches, seen: Iterable[Observation], now_ns: int, settle_ns: int = 0, decision: int = 0
) -> dict[str, Held]:
    """Return what is held after these observations; causes that were not observed stay.

    ``settle_ns`` is for causes that settle. ``decision`` is the number of this decision; it
    observes each cause once, so that identities are unique.
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
    return how is Clears.AT_ONCE or (how is Clears.SETTLED and now_ns - old.bad_ns >= settle_ns)


def latched(held: Latches) -> tuple[str, ...]:
    """Return the names of the causes that want a reset, the worst first."""
    return ordered(name for name in held if clears(name) is Clears.RESET)


def ordered(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names, the worst first."""
    return tuple(sorted(names, key=severity))


def still_there(held: Latches) -> tuple[str, ...]:
    """Return the names of the latched causes that are not gone yet, the worst first."""
    return tuple(name for name in latched(held) if held[name].good < GOOD_SAMPLES)


def begun(held: Latches, decision: int) -> tuple[str, ...]:
    """Return the names of the latched causes that began in this decision, the worst first."""
    return tuple(name for name in latched(held) if held[name].id // len(RULES) == decision)


def named(held: Latches, ids: Container[int]) -> tuple[str, ...]:
    """Return the names of the latched causes with these identities, the worst first."""
    return tuple(name for name in latched(held) if held[name].id in ids)


def reset(held: Latches, ids: Container[int]) -> dict[str, Held]:
    """Return what is held once the latched causes with these identities are cleared, if gone."""
    cleared = set(named(held, ids)).difference(still_there(held))
    return {name: one for name, one in held.items() if name not in cleared}
