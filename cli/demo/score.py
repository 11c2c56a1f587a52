"""Score of the lap: the simulator's trace compared with the services' messages.

Trace and messages use the same host's monotonic clock, so their times are comparable. Lengths in
metres, times in seconds.
"""

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cli.demo.record import LapRecord
from common.freshness import NS_PER_S
from common.motion import Command
from sim import trace as t
from t2.messages import Odometry

Result = tuple[str, str, bool | None]  # quantity, value, whether it is within its limit

# To an obstacle that sonar detects: safety's margin, minus noise and one step of braking.
CLEARANCE_MIN = 0.05
HOME_MAX = 0.25
STOP_MAX = 0.1
ODOMETRY_MAX = 0.15
REST_SAMPLES = 20  # of the truth, which is written at 20 Hz
REACTION_MAX = 0.5  # limit for a busy host; docs/safety.md has the budget


@dataclass(frozen=True, slots=True)
class Trace:
    """Records of the simulator by type."""

    truth: Sequence[t.Truth]
    commands: Sequence[t.Command]
    bumper: Sequence[t.BumperSent]


@dataclass(frozen=True, slots=True)
class Stop:
    """A bumper hit with its reaction."""

    reaction_s: float | None  # from the bumper frame to the BRAKE frame
    distance_m: float | None  # from that frame to standstill; None without standstill
    speed_mps: float  # at the hit


def read(file: Path) -> Trace:
    """Read a trace; the simulator may still be writing it."""
    records = t.read(file.read_bytes())
    return Trace(
        [r for r in records if isinstance(r, t.Truth)],
        [r for r in records if isinstance(r, t.Command)],
        [r for r in records if isinstance(r, t.BumperSent)],
    )


def stops(trace: Trace) -> list[Stop]:
    """Return the reaction to each bumper hit."""
    return [_stop(trace, hit.mono_ns) for hit in trace.bumper if hit.pressed]


def odometry_errors(trace: Trace, odometry: Sequence[Odometry]) -> tuple[float, float]:
    """Return the largest odometry errors in metres: driving, and at rest.

    The error while driving includes the transport delay of a frame; the error at rest does not.
    """
    times = [truth.mono_ns for truth in trace.truth]
    driving = resting = 0.0
    for pose in odometry:
        at = bisect_left(times, pose.mono_ns)
        if at < REST_SAMPLES or at >= len(times):
            continue
        truth = _between(trace.truth[at - 1], trace.truth[at], pose.mono_ns)
        error = math.hypot(pose.x - truth[0], pose.y - truth[1])
        driving = max(driving, error)
        if all(x.linear == 0 and x.angular == 0 for x in trace.truth[at - REST_SAMPLES : at]):
            resting = max(resting, error)
    return driving, resting


def results(trace: Trace, record: LapRecord, fast: bool) -> list[Result]:
    """Return the table of results; a lap is good without a False in it."""
    last = trace.truth[-1]
    wall = min((x.clearance for x in trace.truth if x.clearance is not None), default=math.inf)
    driving, resting = odometry_errors(trace, record.odometry)
    rows: list[Result] = [
        ("lap finished", f"{len(record.steps)} steps", record.finished),
        ("distance driven", f"{last.distance:.2f} m", last.distance > 1.0),
        ("closest to an obstacle", f"{wall:.2f} m", wall > CLEARANCE_MIN),
        ("odometry error, driving", f"{driving * 100:.1f} cm at most", None),
        (
            "odometry error, at rest",
            f"{resting * 100:.1f} cm at most",
            resting < ODOMETRY_MAX,
        ),
    ]
    for number, stop in enumerate(stops(trace), 1):
        reaction = stop.reaction_s
        driven = stop.distance_m
        took = "never" if reaction is None else f"{reaction * 1000:.1f} ms"
        way = "never" if driven is None else f"{driven * 100:.1f} cm"
        rows += [
            (f"contact {number}: frame to BRAKE frame", took,
             reaction is not None and reaction < REACTION_MAX),
            (f"contact {number}: stopped within", f"{way} from {stop.speed_mps:.2f} m/s",
             driven is not None and driven < STOP_MAX),
        ]  # fmt: skip
    if not fast:
        home = math.hypot(last.x, last.y)
        rows.append(("distance from the start at the end", f"{home * 100:.1f} cm", home < HOME_MAX))
    rows.append(("unplanned latches", ", ".join(record.unplanned) or "none", None))
    return rows


def good(rows: Sequence[Result]) -> bool:
    """Return whether all results are within their limits and a contact occurred."""
    met = any(what.startswith("contact") for what, _, _ in rows)
    return met and all(fine is not False for _, _, fine in rows)


def _stop(trace: Trace, hit_ns: int) -> Stop:
    breaks = (c.mono_ns for c in trace.commands if c.mono_ns >= hit_ns and c.kind is Command.BRAKE)
    first = next(breaks, None)
    before = [x for x in trace.truth if x.mono_ns <= hit_ns] or trace.truth[:1]
    after = (x for x in trace.truth if x.mono_ns > hit_ns)
    rest = next((x for x in after if abs(x.linear) < 0.001), None)
    return Stop(
        None if first is None else (first - hit_ns) / NS_PER_S,
        None if rest is None else rest.distance - before[-1].distance,
        max((abs(x.linear) for x in before[-20:]), default=0.0),
    )


def _between(a: t.Truth, b: t.Truth, at_ns: int) -> tuple[float, float]:
    part = (at_ns - a.mono_ns) / max(1, b.mono_ns - a.mono_ns)
    return a.x + part * (b.x - a.x), a.y + part * (b.y - a.y)
