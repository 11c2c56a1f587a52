"""What the campaign found, as a document. Pure."""

from collections.abc import Iterator, Sequence
from math import inf, isfinite

from verification.harness.results import percentile
from verification.roaming.conditions import Outage, Steady
from verification.roaming.figures import Chain, Stream
from verification.roaming.trial import Back, Went

Wents = Sequence[tuple[Steady, Went, float]]  # the last: what the machine held up, s
Backs = Sequence[tuple[Outage, Sequence[Back], float]]


def driving(wents: Wents, asked_mps: float) -> str:
    """Return how it drove."""
    head = (
        "weather",
        "taken in time",
        "longest gap",
        "stops",
        "finger",
        "speed",
        "E: BREAK",
        "E: told",
    )
    rows = [
        [
            weather.name, f"{_percent(w.drive.taken, w.drive.asked)} of {w.drive.asked}",
            _ms(w.drive.gap_s), str(w.drive.stops), str(w.hands), f"{w.speed / asked_mps:.0%}",
            _ms(w.braked_s), _ms(w.told_s),
        ]
        for weather, w, _ in wents
    ]  # fmt: skip
    return table(head, rows)


def seen(wents: Wents) -> str:
    """Return what the laptop saw."""
    head = (
        "weather", "sent to it", "state", "its age", "its longest gap", "odometry", "its age",
        "its longest gap",
    )  # fmt: skip
    rows = [
        [weather.name, f"{w.load_bps / 1e3:.0f} kbit/s", *_stream(w.state), *_stream(w.odometry)]
        for weather, w, _ in wents
    ]
    return table(head, rows)


def own(wents: Wents, backs: Backs) -> str:
    """Return how the robot's own chain went."""
    head = (
        "weather", "bumper", "its longest gap", "odometry", "its longest gap", "lost", "verdict",
        "input's age", "held up",
    )  # fmt: skip
    all_ = [(weather.name, [w.chain], held) for weather, w, held in wents]
    all_ += [(what.name, [back.chain for back in some], held) for what, some, held in backs]
    return table(head, [[name, *_chain(chains), _ms(held)] for name, chains, held in all_])


def _chain(chains: Sequence[Chain]) -> list[str]:
    return [
        f"{min(c.bumper.rate_hz for c in chains):.1f} Hz",
        _ms(max(c.bumper.gap_s for c in chains)),
        f"{min(c.odometry.rate_hz for c in chains):.1f} Hz",
        _ms(max(c.odometry.gap_s for c in chains)),
        str(sum(c.bumper.lost + c.odometry.lost for c in chains)),
        _two([max(c.verdict_s[k] for c in chains) for k in (0, 1)]),
        _two([max(c.input_s[k] for c in chains) for k in (0, 1)]),
    ]


def returning(backs: Backs) -> str:
    """Return what came of the link being down."""
    head = "link", "n", "STOP after", "heard again after", "drives again after", "by"
    rows = []
    for what, some, _ in backs:
        stopped = [back.told_s for back in some if back.told_s is not None]
        by = [_by(back) for back in some]
        rows.append([
            what.name, str(len(some)),
            f"{_two(_spread(stopped))} ({len(stopped)})" if stopped else "drove on",
            _two(_spread([_or_never(back.heard_s) for back in some])),
            _two(_spread([_or_never(back.drove_s) for back in some])),
            ", ".join(f"{word} {by.count(word)}" for word in dict.fromkeys(by)),
        ])  # fmt: skip
    return table(head, rows)


def wrong(backs: Backs, budget_s: float, fresh_s: float) -> list[str]:
    """Return what is not as it should be, in words.

    ``budget_s`` is what a STOP may take, ``fresh_s`` how long safety lives with the last bumper.
    """
    found = []
    for what, some, held_s in backs:
        for back in some:
            faults = [
                *_gaps(back.chain, fresh_s + held_s),
                *_faults(what, back, budget_s + held_s),
            ]
            found += [f"{what.name}: {fault}" for fault in faults]
    return found


def _gaps(chain: Chain, fresh_s: float) -> Iterator[str]:
    lost = chain.bumper.lost + chain.odometry.lost
    if lost:
        yield f"{lost} messages lost on board"
    if chain.bumper.gap_s > fresh_s:
        yield f"no bumper on board for {_ms(chain.bumper.gap_s)}, {_ms(fresh_s)} are allowed"


def _faults(what: Outage, back: Back, budget_s: float) -> list[str]:
    took_s = max(back.told_s or 0.0, back.moved_s)
    faults = []
    if what.seconds > budget_s and back.told_s is None:
        faults.append("it did not stop")
    elif back.told_s is not None and what.seconds > budget_s and took_s > budget_s:
        faults.append(f"STOP after {_ms(took_s)}, {_ms(budget_s)} are allowed")
    return [*faults, "it would not drive again"] if back.drove_s is None else faults


def verdict(wrong: Sequence[str]) -> str:
    """Return the last line of the document."""
    return f"Not as it should be: {'; '.join(wrong)}." if wrong else "All is as it should be."


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table for people."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


def _by(back: Back) -> str:
    if back.drove_s is None:
        return "did not"
    if back.told_s is None:
        return "drove on"
    return f"{back.hands} new press" if back.hands else "itself"


def _stream(it: Stream) -> list[str]:
    return [f"{it.rate_hz:.1f} Hz", _two(it.age_s), _ms(it.gap_s)]


def _spread(values: Sequence[float]) -> tuple[float, float]:
    return percentile(values, 0.5), max(values)


def _or_never(value: float | None) -> float:
    return inf if value is None else value


def _two(values: Sequence[float]) -> str:
    return ", ".join(map(_ms, values))


def _percent(part: int, whole: int) -> str:
    return f"{min(part, whole) / whole:.0%}" if whole else "none"


def _ms(seconds: float | None) -> str:
    if seconds is None or not isfinite(seconds):
        return "never"
    return f"{1000 * seconds:.1f} ms" if seconds < 0.1 else f"{seconds:.2f} s"
