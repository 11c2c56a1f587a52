"""The board's answers in the streams: rates, gaps, losses, restarts; hits of the bumper. Pure."""

from collections.abc import Sequence
from itertools import pairwise
from statistics import median

from msgspec import Struct

from cli.fit.streams import Streams
from common.freshness import NS_PER_S
from t2 import keys
from t2.messages import Bumper, Message


class Answers(Struct, frozen=True, kw_only=True):
    """One stream of the board, while the bridge that published it ran."""

    stream: str
    messages: int
    rate: float  # Hz
    lost: float  # share of the messages at the nominal rate that are missing in gaps
    longest_gap: float  # s


def answers(streams: Streams) -> list[Answers]:
    """Return the statistics of each periodic stream."""
    periodic: tuple[tuple[str, float, Sequence[Message]], ...] = (
        ("velocity", keys.VELOCITY.rate_hz, streams.velocities),
        ("mileage", keys.MILEAGE.rate_hz, streams.mileages),
        ("ultrasonic", keys.ULTRASONIC.rate_hz, streams.ultrasonics),
        ("bumper", keys.BUMPER.rate_hz, streams.bumpers),
    )
    return [_answers(name, hz, all_of) for name, hz, all_of in periodic if len(all_of) > 1]


def _answers(name: str, rate_hz: float, messages: Sequence[Message]) -> Answers:
    gaps = [
        (b.mono_ns - a.mono_ns) / NS_PER_S
        for a, b in pairwise(messages)
        if a.boot == b.boot and b.seq == a.seq + 1  # others are missing in the recording
    ] or [0.0]
    lost = sum(max(0, round(gap * rate_hz) - 1) for gap in gaps)
    return Answers(
        stream=name,
        messages=len(messages),
        rate=1 / median(gaps) if median(gaps) else 0.0,
        lost=lost / (len(gaps) + lost),
        longest_gap=max(gaps),
    )


def round_trips_s(streams: Streams) -> tuple[float, ...]:
    """Return the medians of the queries' round trips that the bridge published."""
    return tuple(link.round_trip for link in streams.links if link.round_trip is not None)


def hits_s(bumpers: Sequence[Bumper]) -> tuple[float, ...]:
    """Return how long each hit of the bumper was reported, from its first sample to the last."""
    found, begin = [], None
    for before, now in pairwise(bumpers):
        if now.pressed and not before.pressed:
            begin = now
        elif before.pressed and not now.pressed and begin is not None:
            found.append((before.mono_ns - begin.mono_ns) / NS_PER_S)
            begin = None
    return tuple(found)


def restarts_s(streams: Streams) -> tuple[float, ...]:
    """Return the silence of the counters at each restart of the board."""
    return tuple(
        (b.mono_ns - a.mono_ns) / NS_PER_S
        for a, b in pairwise(streams.mileages)
        if a.boot == b.boot and b.epoch > a.epoch
    )
