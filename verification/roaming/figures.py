"""Evaluation of message logs and commands. Pure; one clock in nanoseconds, results in seconds."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from common.freshness import NS_PER_S
from sim.trace import Command
from verification.harness.results import percentile
from verification.harness.trace import moves
from verification.roaming.message_log import Entry

STATE, ODOMETRY, BUMPER = "tel/safety/state", "tel/odom/odometry", "tel/bridge/bumper"
MOTION, REQUESTED = "@cmd/motion", "requested"


@dataclass(frozen=True, slots=True)
class Stream:
    """Reception of a stream; infinite without any message."""

    rate_hz: float
    gap_s: float  # longest gap
    age_s: tuple[float, float]  # on arrival: p50, worst
    lost: int  # sent and not received


@dataclass(frozen=True, slots=True)
class ControlChain:
    """Timing of the robot's own control chain."""

    bumper: Stream
    odometry: Stream
    verdict_s: tuple[float, float]  # from a request to its verdict: p50, p99
    input_s: tuple[float, float]  # age of the newest bumper sample at a verdict: p50, p99


@dataclass(frozen=True, slots=True)
class Drive:
    """Requests and motion."""

    requested: int  # requests that left the laptop
    accepted: int  # by safety
    gap_s: float  # longest time between two accepted requests
    stops: int  # of the vehicle


def stream(entries: Sequence[Entry], key: str, since_ns: int, until_ns: int) -> Stream:
    """Return the reception of a key in this period."""
    mine = [entry for entry in entries if entry.key == key]
    ages = [(entry.at_ns - entry.sent_ns) / NS_PER_S for entry in mine] or [float("inf")]
    gap_s = longest_s([entry.at_ns for entry in mine], since_ns, until_ns)
    rate_hz = len(mine) * NS_PER_S / (until_ns - since_ns)
    sent = mine[-1].seq - mine[0].seq + 1 if mine else 0
    return Stream(rate_hz, gap_s, (percentile(ages, 0.5), max(ages)), sent - len(mine))


def control_chain(entries: Sequence[Entry], since_ns: int, until_ns: int) -> ControlChain:
    """Return the timing of the control chain in this period."""
    motions = [entry for entry in entries if entry.key == MOTION]
    return ControlChain(
        bumper=stream(entries, BUMPER, since_ns, until_ns),
        odometry=stream(entries, ODOMETRY, since_ns, until_ns),
        verdict_s=_ranks([(m.sent_ns - m.heard_ns) / NS_PER_S for m in motions if m.heard_ns]),
        input_s=_ranks([(m.sent_ns - m.judged_ns) / NS_PER_S for m in motions if m.judged_ns]),
    )


def drive(
    robot: Sequence[Entry],
    laptop: Sequence[Entry],
    commands: Sequence[Command],
    since_ns: int,
    until_ns: int,
) -> Drive:
    """Return requests and motion in this period."""
    accepted = [entry.heard_ns for entry in robot if entry.key == MOTION and entry.heard_ns]
    return Drive(
        requested=sum(entry.key == REQUESTED for entry in laptop),
        accepted=len(accepted),
        gap_s=longest_s(accepted, since_ns, until_ns),
        stops=stops([c for c in commands if since_ns <= c.mono_ns < until_ns]),
    )


def stops(commands: Sequence[Command]) -> int:
    """Count the transitions from a moving to a stopping command."""
    return sum(moves(before) and not moves(after) for before, after in pairwise(commands))


def longest_s(times_ns: Sequence[int], since_ns: int, until_ns: int) -> float:
    """Return the longest gap between these times."""
    edges = [since_ns, *sorted(times_ns), until_ns]
    return max(b - a for a, b in pairwise(edges)) / NS_PER_S


def _ranks(values: Sequence[float]) -> tuple[float, float]:
    return (
        (percentile(values, 0.5), percentile(values, 0.99))
        if values
        else (float("inf"), float("inf"))
    )
