"""The board's answers in the streams: rates, gaps, losses, order, restarts; bumper hits. Pure.

The queries themselves are not recorded. But the bridge sends its link message right after the
queries of a tick, so these messages show when ticks were, and those between follow at 20 ms.
"""

from bisect import bisect_right
from collections import Counter, defaultdict
from collections.abc import Sequence
from itertools import pairwise
from statistics import median, quantiles

from msgspec import Struct

from cli.fit.streams import Streams
from common.freshness import NS_PER_S
from services.bridge.core.core import TICK_S
from t2 import keys
from t2.messages import Bumper, Message

TICK_NS = round(TICK_S * NS_PER_S)
EARLY_NS = TICK_NS // 4  # by which a tick may be before its reckoned time
LINKED_NS = NS_PER_S // 4  # between two link messages at most; their ticks are 0.2 s apart


class Answers(Struct, frozen=True, kw_only=True):
    """One stream of the board, while the bridge that published it ran."""

    stream: str
    messages: int
    rate: float  # Hz
    lost: float  # share of the messages at the nominal rate that are missing in gaps
    longest_gap: float  # s
    jitter: float  # s, from the 5 % to the 95 % quantile of the gaps


class Order(Struct, frozen=True, kw_only=True):
    """The order of the answers after the queries of one tick."""

    delays: dict[str, float]  # s, medians from the end of the tick, the usual first stream first
    cycles: int  # with the answers of two streams or more
    usual: float  # share of them in this order
    late: dict[str, int]  # cycles in another order, by the stream that was late


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
        jitter=(cuts := quantiles(gaps, n=20, method="inclusive"))[-1] - cuts[0] if gaps[1:] else 0,
    )


def order(streams: Streams) -> Order | None:
    """Return the order of the answers; None if the recording does not show it.

    Velocities come unasked, so they have no place in it. A round trip of most of a tick is too long
    to assign an answer to its query.
    """
    trips = round_trips_s(streams)
    if not trips or median(trips) > TICK_S / 2:
        return None
    ticks = [link.mono_ns for link in streams.links]
    cycles: defaultdict[tuple[int, int], dict[str, int]] = defaultdict(dict)
    asked: tuple[tuple[str, Sequence[Message]], ...] = (
        ("bumper", streams.bumpers),
        ("mileage", streams.mileages),
        ("ultrasonic", streams.ultrasonics),
    )
    for name, messages in asked:
        for each in messages:
            last = bisect_right(ticks, each.mono_ns + EARLY_NS) - 1
            since_ns = each.mono_ns - ticks[last] + EARLY_NS
            if last >= 0 and since_ns < LINKED_NS:
                number, delay_ns = divmod(since_ns, TICK_NS)
                cycles[last, number].setdefault(name, delay_ns - EARLY_NS)
    return _ordered([cycle for cycle in cycles.values() if len(cycle) > 1])


def _ordered(cycles: Sequence[dict[str, int]]) -> Order | None:
    """Return the usual order, of the cycles with all streams, and what deviates from it."""
    if not cycles:
        return None
    most = max(map(len, cycles))
    ways = Counter(tuple(sorted(it, key=it.__getitem__)) for it in cycles if len(it) == most)
    ((usual, _),) = ways.most_common(1)
    cycles = [cycle for cycle in cycles if cycle.keys() <= set(usual)]
    medians = {name: median(it[name] for it in cycles if name in it) for name in usual}
    late: Counter[str] = Counter()
    for cycle in cycles:
        if sorted(cycle, key=cycle.__getitem__) != sorted(cycle, key=usual.index):
            late[max(cycle, key=lambda name: cycle[name] - medians[name])] += 1
    return Order(
        delays={name: medians[name] / NS_PER_S for name in usual},
        cycles=len(cycles),
        usual=1 - late.total() / len(cycles),
        late=dict(late.most_common()),
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
