"""When the board's counters have started anew."""

import math

from common.messages import Mileage

# No driving explains more than this between two samples; a board that has just been powered on
# counts from zero, so a step to zero is believed to be one much sooner.
FAST_MPS, FAST_RADPS, STEP = 5.0, 5.0, 1.0
DRIVEN_MPS, TURNED_RADPS, STEP_TO_ZERO = 1.5, 2.0, 0.02
ZERO_M = 0.005
ZERO_RAD = math.radians(0.5)
GAP_MAX_S = 0.2  # after a longer one the link was lost, and the board counts as new anyway


def restarted(before: Mileage, after: Mileage, gap_s: float) -> bool:
    """Tell whether the counters jumped, ``gap_s`` after the last sample."""
    gap_s = min(gap_s, GAP_MAX_S)
    distance = abs(after.distance - before.distance)
    turn = abs(math.remainder(after.heading - before.heading, math.tau))
    if abs(after.distance) <= ZERO_M and abs(after.heading) <= ZERO_RAD:
        too_far = distance > STEP_TO_ZERO + DRIVEN_MPS * gap_s
        return too_far or turn > STEP_TO_ZERO + TURNED_RADPS * gap_s
    return distance > STEP + FAST_MPS * gap_s or turn > STEP + FAST_RADPS * gap_s
