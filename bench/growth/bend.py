"""Where a curve bends: from where on its cost grows faster than the number. Pure."""

from collections.abc import Sequence

# What the cost may grow beyond the number and still count as in step: CPU time is told in steps of
# 10 ms, and others use the machine.
MARGIN = 1.25

Point = tuple[float, float]  # a number, and what it costs


def bend(points: Sequence[Point], margin: float = MARGIN) -> float | None:
    """Return the first number from which on cost outgrows number up to every later point.

    That is: for each later one the cost is more times that of here than the number is, by more
    than the margin. None where that is so of no number; the last one has none behind it.
    """
    rising = sorted(points)
    for index, (number, cost) in enumerate(rising[:-1]):
        if cost > 0 and all(c / cost > margin * n / number for n, c in rising[index + 1 :]):
            return number
    return None
