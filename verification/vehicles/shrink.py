"""Shrinker: the parameters of a failing draw that matter."""

from collections.abc import Callable

from verification.vehicles.draw import Draw


def shrink(draw: Draw, fails: Callable[[Draw], bool]) -> Draw:
    """Return a draw that still fails, and with no parameter less does.

    Each parameter is set to its default, one after the other, until none can be spared. A failure
    that needs chance (the noise of another parameter) may keep a parameter that only changes it.
    """
    names = list(draw.values)
    while names:
        spared = []
        for name in names:
            smaller = draw.without(name)
            if fails(smaller):
                draw = smaller
                spared.append(name)
        names = list(draw.values) if spared else []
    return draw
