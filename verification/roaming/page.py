"""Blocks of the document of the campaign. Pure."""

from collections.abc import Iterator, Sequence
from math import inf, isfinite

from verification.harness.results import percentile, table
from verification.roaming.conditions import Condition, Outage
from verification.roaming.figures import ControlChain, Stream
from verification.roaming.trial import DriveResult, OutageResult

DriveRows = Sequence[tuple[Condition, DriveResult, float]]  # the last: longest stall of the host, s
OutageRows = Sequence[tuple[Outage, Sequence[OutageResult], float]]


def block(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table that ends with a line end."""
    return table(head, rows) + "\n"


def driving(drives: DriveRows, asked_mps: float) -> str:
    """Return the table of driving."""
    head = (
        "condition",
        "accepted in time",
        "longest gap",
        "stops",
        "presses",
        "speed",
        "E: BRAKE",
        "E: confirmed",
    )
    rows = [
        [
            condition.name,
            f"{_percent(w.drive.accepted, w.drive.requested)} of {w.drive.requested}",
            _ms(w.drive.gap_s), str(w.drive.stops), str(w.presses), f"{w.speed / asked_mps:.0%}",
            _ms(w.braked_s), _ms(w.confirmed_s),
        ]
        for condition, w, _ in drives
    ]  # fmt: skip
    return block(head, rows)


def seen(drives: DriveRows) -> str:
    """Return the table of streams on the laptop."""
    head = (
        "condition", "sent to it", "state", "its age", "its longest gap", "odometry", "its age",
        "its longest gap",
    )  # fmt: skip
    rows = [
        [condition.name, f"{w.load_bps / 1e3:.0f} kbit/s", *_stream(w.state), *_stream(w.odometry)]
        for condition, w, _ in drives
    ]
    return block(head, rows)


def own(drives: DriveRows, outages: OutageRows) -> str:
    """Return the table of the robot's control chain."""
    head = (
        "condition", "bumper", "its longest gap", "odometry", "its longest gap", "lost", "verdict",
        "input's age", "stall",
    )  # fmt: skip
    all_ = [(condition.name, [w.chain], held) for condition, w, held in drives]
    all_ += [(what.name, [back.chain for back in some], held) for what, some, held in outages]
    return block(head, [[name, *_chain(chains), _ms(held)] for name, chains, held in all_])


def _chain(chains: Sequence[ControlChain]) -> list[str]:
    return [
        f"{min(c.bumper.rate_hz for c in chains):.1f} Hz",
        _ms(max(c.bumper.gap_s for c in chains)),
        f"{min(c.odometry.rate_hz for c in chains):.1f} Hz",
        _ms(max(c.odometry.gap_s for c in chains)),
        str(sum(c.bumper.lost + c.odometry.lost for c in chains)),
        _two([max(c.verdict_s[k] for c in chains) for k in (0, 1)]),
        _two([max(c.input_s[k] for c in chains) for k in (0, 1)]),
    ]


def returning(outages: OutageRows) -> str:
    """Return the table of outages."""
    head = "link", "n", "STOP after", "received again after", "drives again after", "by"
    rows = []
    for what, some, _ in outages:
        stopped = [back.stopped_s for back in some if back.stopped_s is not None]
        by = [_by(back) for back in some]
        rows.append([
            what.name, str(len(some)),
            f"{_two(_spread(stopped))} ({len(stopped)})" if stopped else "drove on",
            _two(_spread([_or_never(back.received_s) for back in some])),
            _two(_spread([_or_never(back.drove_s) for back in some])),
            ", ".join(f"{word} {by.count(word)}" for word in dict.fromkeys(by)),
        ])  # fmt: skip
    return block(head, rows)


def wrong(outages: OutageRows, budget_s: float, fresh_s: float) -> list[str]:
    """Return the violations.

    ``budget_s`` is the limit for STOP, ``fresh_s`` the largest age of a bumper sample.
    """
    found = []
    for what, some, stall_s in outages:
        for back in some:
            faults = [
                *_gaps(back.chain, fresh_s + stall_s),
                *_faults(what, back, budget_s + stall_s),
            ]
            found += [f"{what.name}: {fault}" for fault in faults]
    return found


def _gaps(chain: ControlChain, fresh_s: float) -> Iterator[str]:
    lost = chain.bumper.lost + chain.odometry.lost
    if lost:
        yield f"{lost} messages lost on board"
    if chain.bumper.gap_s > fresh_s:
        yield f"no bumper on board for {_ms(chain.bumper.gap_s)}, {_ms(fresh_s)} are allowed"


def _faults(what: Outage, back: OutageResult, budget_s: float) -> list[str]:
    took_s = max(back.stopped_s or 0.0, back.moved_s)
    faults = []
    if what.seconds > budget_s and back.stopped_s is None:
        faults.append("it did not stop")
    elif back.stopped_s is not None and what.seconds > budget_s and took_s > budget_s:
        faults.append(f"STOP after {_ms(took_s)}, {_ms(budget_s)} are allowed")
    return [*faults, "it does not drive again"] if back.drove_s is None else faults


def verdict(wrong: Sequence[str]) -> str:
    """Return the last line of the document."""
    return (
        f"Outside the limits: {'; '.join(wrong)}."
        if wrong
        else "All results are within the limits."
    )


def _by(back: OutageResult) -> str:
    if back.drove_s is None:
        return "did not"
    if back.stopped_s is None:
        return "drove on"
    return f"{back.presses} new press" if back.presses else "itself"


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
