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


def restarted(before: Mileage, after: Mileage, gap_s: float, *, unbroken: bool) -> bool:
    """Tell whether the counters jumped, ``gap_s`` after the last sample.

    ``unbroken`` says that the board was heard all the while, if not its counters: then it drove.
    """
    short_s = min(gap_s, GAP_MAX_S)
    driven_s = gap_s if unbroken else short_s
    distance = abs(after.distance - before.distance)
    turn = abs(math.remainder(after.heading - before.heading, math.tau))
    if abs(after.distance) <= ZERO_M and abs(after.heading) <= ZERO_RAD:
        too_far = distance > STEP_TO_ZERO + DRIVEN_MPS * short_s
        return too_far or turn > STEP_TO_ZERO + TURNED_RADPS * short_s
    return distance > STEP + FAST_MPS * driven_s or turn > STEP + FAST_RADPS * driven_s
