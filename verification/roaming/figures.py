"""What notes and commands come to. Pure; times of one clock, in nanoseconds, results in seconds."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from common.freshness import NS_PER_S
from sim.trace import Command
from verification.harness.results import percentile
from verification.harness.trace import moves
from verification.roaming.notes import Note

STATE, ODOMETRY, BUMPER = "tel/safety/state", "tel/odom/odometry", "tel/bridge/bumper"
MOTION, ASKED = "@cmd/motion", "asked"


@dataclass(frozen=True, slots=True)
class Stream:
    """How a stream arrived; infinite where nothing came."""

    rate_hz: float
    gap_s: float  # the longest time without
    age_s: tuple[float, float]  # on arrival: p50, worst
    lost: int  # that were sent and did not arrive


@dataclass(frozen=True, slots=True)
class Chain:
    """How the robot's own chain went meanwhile."""

    bumper: Stream
    odometry: Stream
    verdict_s: tuple[float, float]  # from a request to its verdict: p50, p99
    input_s: tuple[float, float]  # how old the newest bumper sample was at a verdict: p50, p99


@dataclass(frozen=True, slots=True)
class Drive:
    """How it drove."""

    asked: int  # requests that left the laptop
    taken: int  # that safety took
    gap_s: float  # the longest time between two that it took
    stops: int  # of the vehicle


def stream(notes: Sequence[Note], key: str, since_ns: int, until_ns: int) -> Stream:
    """Return how a key arrived in this time."""
    mine = [note for note in notes if note.key == key]
    ages = [(note.at_ns - note.sent_ns) / NS_PER_S for note in mine] or [float("inf")]
    gap_s = longest_s([note.at_ns for note in mine], since_ns, until_ns)
    rate_hz = len(mine) * NS_PER_S / (until_ns - since_ns)
    sent = mine[-1].seq - mine[0].seq + 1 if mine else 0
    return Stream(rate_hz, gap_s, (percentile(ages, 0.5), max(ages)), sent - len(mine))


def chain(notes: Sequence[Note], since_ns: int, until_ns: int) -> Chain:
    """Return how the robot's own chain went in this time."""
    motions = [note for note in notes if note.key == MOTION]
    return Chain(
        bumper=stream(notes, BUMPER, since_ns, until_ns),
        odometry=stream(notes, ODOMETRY, since_ns, until_ns),
        verdict_s=_ranks([(m.sent_ns - m.heard_ns) / NS_PER_S for m in motions if m.heard_ns]),
        input_s=_ranks([(m.sent_ns - m.judged_ns) / NS_PER_S for m in motions if m.judged_ns]),
    )


def drive(
    robot: Sequence[Note],
    laptop: Sequence[Note],
    commands: Sequence[Command],
    since_ns: int,
    until_ns: int,
) -> Drive:
    """Return how it drove in this time."""
    taken = [note.heard_ns for note in robot if note.key == MOTION and note.heard_ns]
    return Drive(
        asked=sum(note.key == ASKED for note in laptop),
        taken=len(taken),
        gap_s=longest_s(taken, since_ns, until_ns),
        stops=stops([c for c in commands if since_ns <= c.mono_ns < until_ns]),
    )


def stops(commands: Sequence[Command]) -> int:
    """Count how often a command to move was followed by one that is none."""
    return sum(moves(before) and not moves(after) for before, after in pairwise(commands))


def longest_s(times_ns: Sequence[int], since_ns: int, until_ns: int) -> float:
    """Return the longest time without any of these."""
    edges = [since_ns, *sorted(times_ns), until_ns]
    return max(b - a for a, b in pairwise(edges)) / NS_PER_S


def _ranks(values: Sequence[float]) -> tuple[float, float]:
    return (
        (percentile(values, 0.5), percentile(values, 0.99))
        if values
        else (float("inf"), float("inf"))
    )
