"""Score of the lap: the simulator's trace compared with the services' messages.

Trace and messages use the same host's monotonic clock, so their times are comparable. Lengths in
metres, times in seconds.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from common.freshness import NS_PER_S
from sim import trace as t
from t2.messages import Command

Result = tuple[str, str, bool]  # quantity, value, whether it is within its limit

# To an obstacle that sonar detects: safety's margin, minus noise and one step of braking.
CLEARANCE_MIN = 0.05
HOME_MAX = 0.25
STOP_MAX = 0.1
REACTION_MAX = 0.5  # limit for a busy host; docs/safety.md has the budget


@dataclass(frozen=True, slots=True)
class Trace:
    """Records of the simulator by type."""

    truth: Sequence[t.Truth]
    commands: Sequence[t.Command]
    bumper: Sequence[t.BumperSent]


class Stop(NamedTuple):
    """A bumper hit with its reaction."""

    reaction_s: float | None  # from the bumper frame to the BRAKE frame
    distance_m: float | None  # from that frame to standstill; None without standstill


def read(file: Path) -> Trace:
    """Read a trace; the simulator may still be writing it."""
    records = t.read(file.read_bytes())
    return Trace(
        [r for r in records if isinstance(r, t.Truth)],
        [r for r in records if isinstance(r, t.Command)],
        [r for r in records if isinstance(r, t.BumperSent)],
    )


def results(trace: Trace) -> list[Result]:
    """Return the table of results."""
    last = trace.truth[-1]
    wall = min((x.clearance for x in trace.truth if x.clearance is not None), default=math.inf)
    home = math.hypot(last.x, last.y)
    rows: list[Result] = [
        ("closest to an obstacle", f"{wall:.2f} m", wall > CLEARANCE_MIN),
        ("distance from the start at the end", f"{home * 100:.1f} cm", home < HOME_MAX),
    ]
    for number, (reaction_s, driven_m) in enumerate(stops(trace), 1):
        took = "never" if reaction_s is None else f"{reaction_s * 1000:.1f} ms"
        way = "never" if driven_m is None else f"{driven_m * 100:.1f} cm"
        braked = reaction_s is not None and reaction_s < REACTION_MAX
        stood = driven_m is not None and driven_m < STOP_MAX
        rows.append((f"contact {number}: frame to BRAKE frame", took, braked))
        rows.append((f"contact {number}: stopped within", way, stood))
    return rows


def good(rows: Sequence[Result]) -> bool:
    """Return whether all results are within their limits and a contact occurred."""
    met = any(what.startswith("contact") for what, _, _ in rows)
    return met and all(fine for _, _, fine in rows)


def stops(trace: Trace) -> Iterator[Stop]:
    """Yield the reaction to each bumper hit."""
    for hit_ns in (hit.mono_ns for hit in trace.bumper if hit.pressed):
        brakes = (c.mono_ns for c in trace.commands if c.kind is Command.BRAKE)
        first = next((at_ns for at_ns in brakes if at_ns >= hit_ns), None)
        before = [x for x in trace.truth if x.mono_ns <= hit_ns] or trace.truth[:1]
        after = (x for x in trace.truth if x.mono_ns > hit_ns)
        rest = next((x for x in after if abs(x.linear) < 0.001), None)
        yield Stop(
            None if first is None else (first - hit_ns) / NS_PER_S,
            None if rest is None else rest.distance - before[-1].distance,
        )
