"""Detection of a board that has restarted, by a jump of its counters. Pure."""

import math

from t2.messages import Mileage

# Maximum motion between two samples. A board that was just powered on counts from zero, so the
# limit for a step to zero is much lower, after any time: it is very unlikely to drive to within
# 5 mm of the power-on position while nothing is received.
FAST_MPS, FAST_RADPS, STEP = 5.0, 5.0, 1.0
DRIVEN_MPS, TURNED_RADPS, STEP_TO_ZERO = 1.5, 2.0, 0.02
ZERO_M = 0.005
ZERO_RAD = math.radians(0.5)
GAP_MAX_S = 0.2  # of a gap with a lost link that counts as driving: the board may have been off


def restarted(
    before: Mileage, after: Mileage, gap_s: float, *, unbroken: bool, silent: bool
) -> bool:
    """Return whether the board's counters jumped, ``gap_s`` after the last sample.

    ``unbroken``: other frames of the board were received throughout, so it may have driven.
    ``silent``: the whole board was silent meanwhile, for some periods of its velocity.
    """
    short_s = min(gap_s, GAP_MAX_S)
    if silent and _from_zero(before, after, short_s):
        return True
    driven_s = gap_s if unbroken else short_s
    distance = abs(after.distance - before.distance)
    turn = abs(math.remainder(after.heading - before.heading, math.tau))
    if abs(after.distance) <= ZERO_M and abs(after.heading) <= ZERO_RAD:
        too_far = distance > STEP_TO_ZERO + DRIVEN_MPS * short_s
        return too_far or turn > STEP_TO_ZERO + TURNED_RADPS * short_s
    return distance > STEP + FAST_MPS * driven_s or turn > STEP + FAST_RADPS * driven_s


# After a short silence of the whole board, which may have been off, a smaller step is enough.
def _from_zero(before: Mileage, after: Mileage, short_s: float) -> bool:
    """Return whether both counters may have restarted at zero, and driving explains one not.

    A vehicle that drives past its power-on position must not count as a restart.
    The emergency brakes are sent after such a silence in any case.
    """
    near = (
        abs(after.distance) <= ZERO_M + DRIVEN_MPS * short_s
        and abs(after.heading) <= ZERO_RAD + TURNED_RADPS * short_s
    )
    nearer = (
        abs(before.distance) - abs(after.distance) > STEP_TO_ZERO + DRIVEN_MPS * short_s
        or abs(before.heading) - abs(after.heading) > STEP_TO_ZERO + TURNED_RADPS * short_s
    )
    return near and nearer
