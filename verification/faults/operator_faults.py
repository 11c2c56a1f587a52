"""Faults between operator and robot: late calls, a stalled terminal. Part of the catalogue."""

from verification.faults import injectors
from verification.faults.fault import Fault, Outcome, by_limit, within

NEUTRAL: tuple[Outcome, ...] = ("after a neutral",)
RESET: tuple[Outcome, ...] = ("after a reset",)

# Delayed calls have no effect: no frame moves the vehicle, and the latch stays.
CALLS = [
    Fault("contact, then 20 resets 1.3 s late", injectors.late_resets, RESET, within(0.02)),
    Fault("contact, then 20 releases 1.3 s late", injectors.late_releases, RESET, within(0.02)),
]

# Late keys move nothing: the hold of the last key in time ends, also when it is a first press.
TERMINAL = [
    Fault(f"teleop's terminal stalled for {seconds:g} s, then the burst",
          injectors.stall_terminal(seconds), NEUTRAL,
          by_limit(lambda config: config.teleop.hold_first + 0.15
                   + config.safety.sources["teleop"].lease),
          hold_s=seconds + 1.0, needs="teleop")
    for seconds in (0.8, 3.0)
]  # fmt: skip
