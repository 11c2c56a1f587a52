"""Faults of a stack behind a relay: the PC may fail as a whole. Part of the catalogue."""

import signal

from sim.requests import Flood
from verification.faults import injectors, relay
from verification.faults.fault import Fault, Outcome, within

NEUTRAL: tuple[Outcome, ...] = ("after a neutral",)
RESET: tuple[Outcome, ...] = ("after a reset",)
LEASE = within(0.2 + 0.05)  # of the relay
CUT_S, DEAD_S = 0.5, 0.3
START_S = 0.5  # of a relay
RESOLVE_S = 0.2  # of an address, once a cable is back

RELAY = [
    Fault("relay: everything on the PC killed", relay.kill_pc, (*NEUTRAL, *RESET), LEASE,
          hold_s=0.6, needs="relay"),
    Fault("relay: everything on the PC stopped", relay.stop_pc, (*NEUTRAL, *RESET), LEASE,
          relay.continue_pc, hold_s=0.6, needs="relay"),
    Fault("relay: everything on the PC killed in a flood of the board",
          injectors.in_sequence(injectors.do(Flood(seconds=0.9)), relay.kill_pc),
          (*NEUTRAL, *RESET), LEASE, hold_s=1.0, needs="relay"),
    Fault("relay: the PC's cable cut for 0.5 s", relay.cut("pc", CUT_S), (*NEUTRAL, *RESET),
          LEASE, hold_s=1.0, needs="relay"),
    # Here the board holds the last RUN until its cable, or the relay, is back.
    Fault("relay: the board's cable cut for 0.5 s", relay.cut("board", CUT_S),
          (*NEUTRAL, *RESET), within(CUT_S + RESOLVE_S), hold_s=1.0, needs="relay"),
    Fault("relay SIGKILL, started again after 0.3 s", relay.restart(DEAD_S), (*NEUTRAL, *RESET),
          within(DEAD_S + START_S), hold_s=1.2, needs="relay"),
    Fault("relay: contact", injectors.hit(0.3), RESET, within(0.02), needs="relay"),
    Fault("relay: bridge SIGKILL", injectors.kill("bridge", signal.SIGKILL), NEUTRAL,
          within(0.01), needs="relay"),
]  # fmt: skip
