"""The relay's core: datagrams and time in, datagrams to send out. Pure.

The relay passes RUN to the board only while ``braking`` is empty. Otherwise it sends BRAKE at once
and at 20 Hz, indefinitely, and withholds every datagram with a RUN that is not neutral:

========= ============================================== ===================================
braking   begins with                                    ends with
========= ============================================== ===================================
start     the start of the relay                         a neutral command of the PC
silent    no motion command of the PC for 200 ms         a neutral command of the PC
hit       the first pressed bumper sample after three    a neutral command of the PC, which
          clear ones in a row, or after 200 ms without   the bridge sends on each new hit:
          a sample                                       its own reflex is BRAKE
========= ============================================== ===================================

Neutral is STOP, BRAKE, or RUN with both velocities zero. A pressed bumper alone holds nothing: the
held release drives off it, and each further hit brakes again.

The lease counts from the earliest time at which a datagram may have arrived, not from its handling:
what waited for 200 ms in the queue of a stalled relay neither renews the lease nor passes.

To the board only datagrams of valid frames pass, so no RUN passes that the relay does not
recognise. To the PC everything passes.
"""

import json
from collections import Counter

from .wire import BRAKE, bumper_samples, is_neutral, motions

VERSION = "0.1.0"  # as of sdk/t2/messages.py, which is not there
NS_PER_S = 1_000_000_000
LEASE_NS = NS_PER_S // 5
BRAKE_PERIOD_NS = NS_PER_S // 20
REPORT_PERIOD_NS = NS_PER_S // 10
CLEAR_SAMPLES = 3

BOARD, PC, REPORT = "board", "pc", "report"  # the report goes to the PC, from a port of its own
Send = tuple[str, int, bytes]  # to, index of the port, datagram


class Relay:
    """Passes datagrams, and brakes when the PC is silent or the bumper is hit."""

    def __init__(self, now_ns: int, ports: int = 2) -> None:
        """Begin braking; ``ports`` is the number of UDP ports of the PC."""
        self.braking = "start"
        self.counters: Counter[str] = Counter()
        self._brakes = [(BOARD, port, BRAKE) for port in range(ports)]
        self._started_ns = now_ns
        self._renewed_ns = now_ns - LEASE_NS
        self._braked_ns = now_ns - BRAKE_PERIOD_NS
        self._reported_ns = now_ns - REPORT_PERIOD_NS
        self._pressed = False
        self._sampled_ns = now_ns
        self._clear = [0] * ports  # samples in a row, by port: copies must not count twice

    def from_pc(self, datagram: bytes, port: int, received_ns: int, now_ns: int) -> list[Send]:
        """Process a datagram of the PC that arrived at ``received_ns`` or later."""
        sends = self.tick(now_ns)
        commands = motions(datagram)
        if commands is None:
            self.counters["garbage"] += 1
            return sends
        if commands:
            neutral = all(map(is_neutral, commands))
            if now_ns - received_ns > LEASE_NS or (self.braking and not neutral):
                self.counters["withheld"] += 1
                return sends
            self._renewed_ns = max(self._renewed_ns, received_ns)
            self.braking = ""
        self.counters["to_board"] += 1
        return [*sends, (BOARD, port, datagram)]

    def from_board(self, datagram: bytes, port: int, now_ns: int) -> list[Send]:
        """Process a datagram of the board: the BRAKE for a new hit, then the datagram itself."""
        hits = [self._is_new_hit(pressed, port, now_ns) for pressed in bumper_samples(datagram)]
        sends = self.brake(now_ns, "hit") if any(hits) else []
        self.counters["to_pc"] += 1
        return [*sends, (PC, port, datagram)]

    def tick(self, now_ns: int) -> list[Send]:
        """Return what is due: BRAKE, and the report as JSON."""
        sends: list[Send] = []
        if self.braking in ("", "hit") and now_ns - self._renewed_ns > LEASE_NS:
            sends += self.brake(now_ns, "silent")
        elif self.braking and now_ns - self._braked_ns >= BRAKE_PERIOD_NS:
            sends += self.brake(now_ns)
        if now_ns - self._reported_ns >= REPORT_PERIOD_NS:
            self._reported_ns = now_ns
            uptime = (now_ns - self._started_ns) / NS_PER_S
            report = {"version": VERSION, "braking": self.braking, "uptime": uptime}
            text = json.dumps({**report, "counters": self.counters})
            sends.append((REPORT, 0, text.encode()))
        return sends

    def brake(self, now_ns: int, why: str = "") -> list[Send]:
        """Return BRAKE, for a new reason if given, from each port: the board may take one only."""
        self.braking, self._braked_ns = why or self.braking, now_ns
        self.counters[why or "repeats"] += 1
        return self._brakes

    def _is_new_hit(self, pressed: bool, port: int, now_ns: int) -> bool:
        was_pressed = self._pressed and now_ns - self._sampled_ns <= LEASE_NS
        self._sampled_ns = now_ns
        if pressed:
            self._pressed, self._clear = True, [0] * len(self._clear)
            return not was_pressed
        self._clear[port] += 1
        self._pressed = was_pressed and self._clear[port] < CLEAR_SAMPLES
        return False
