"""Which causes are held, since when, and what a reset may clear.

A cause is observed with a *token*, the identity of the sample that shows it. Good samples are
counted by tokens, so that looking twice at one sample proves nothing twice.
"""

from collections.abc import Iterable, Mapping

from msgspec import Struct
from msgspec.structs import replace

from services.safety.causes import BY_NAME, Clears, clears, severity

Token = tuple[int, int]  # boot and seq of a sample, or (0, time) where there is none

GOOD_SAMPLES = 3  # so many without the cause before a reset may clear it


class Observation(Struct, frozen=True):
    """Whether a sample shows a cause, and what to tell the operator."""

    name: str
    present: bool
    token: Token
    text: str = ""


class Held(Struct, frozen=True):
    """A cause that is in force."""

    since_ns: int
    bad_ns: int  # when it was last seen
    good: int  # samples without it since
    token: Token
    text: str


Latches = Mapping[str, Held]


def observe(
    held: Latches, seen: Iterable[Observation], now_ns: int, settle_ns: int = 0
) -> dict[str, Held]:
    """Return what is held after these observations; causes that were not observed stay.

    ``settle_ns`` is for causes that settle.
    """
    result = dict(held)
    for one in seen:
        old = held.get(one.name)
        if one.present:
            since_ns = old.since_ns if old else now_ns
            text = one.text or BY_NAME[one.name].text
            result[one.name] = Held(since_ns, now_ns, 0, one.token, text)
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


def reset(held: Latches) -> dict[str, Held]:
    """Return what is held once the latched causes that are gone are cleared."""
    stays = still_there(held)
    return {
        name: one for name, one in held.items() if clears(name) is not Clears.RESET or name in stays
    }
