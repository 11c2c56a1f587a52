"""When the board's counters have started anew."""

import math

from common.messages import Mileage

# No driving explains more than this between two samples. A board that has just been powered on
# counts from zero: a step to zero is believed to be a restart much sooner, after any time, because
# hardly anybody drives to within 5 mm of where the board was powered on while nothing is heard.
FAST_MPS, FAST_RADPS, STEP = 5.0, 5.0, 1.0
DRIVEN_MPS, TURNED_RADPS, STEP_TO_ZERO = 1.5, 2.0, 0.02
ZERO_M = 0.005
ZERO_RAD = math.radians(0.5)
GAP_MAX_S = 0.2  # counted of a gap in which the link was lost: it may be the board that was off


def restarted(
    before: Mileage, after: Mileage, gap_s: float, *, unbroken: bool, silent: bool = False
) -> bool:
    """Tell whether the counters jumped, ``gap_s`` after the last sample.

    ``unbroken`` says that the board was heard all the while, if not its counters: then it drove.
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


# After a short silence of the whole board a smaller step is enough: it may have been off.
def _from_zero(before: Mileage, after: Mileage, short_s: float) -> bool:
    """Return whether both counters may have restarted at zero, and one is too near to it.

    Too near for driving: a vehicle that passes its power-on place is no board that restarted.
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
