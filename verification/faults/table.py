"""What all trials of a fault show, as a row; whether that is as it should be. Pure."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from verification.faults.trial import Sample


@dataclass(frozen=True, slots=True)
class Row:
    """One fault and its samples."""

    name: str
    budget_s: float | None
    outcomes: Sequence[str]  # that are as they should be
    samples: Sequence[Sample]
    held_up_s: Sequence[float]  # what the machine took away during each sample

    @property
    def machine_s(self) -> list[float]:
        """Return what of each sample is the machine's: held up, or busy ending what was killed."""
        return [
            held + sample.death_s for held, sample in zip(self.held_up_s, self.samples, strict=True)
        ]

    @property
    def faults(self) -> list[str]:
        """Return what is not as it should be, in words."""
        found = [
            f"{sample.outcome or 'would not drive again'}, not {' or '.join(self.outcomes)}"
            for sample in self.samples
            if sample.outcome not in self.outcomes
        ]
        found += ["a command that nobody asked for" for s in self.samples if s.strayed]
        found += [f"{name} ended" for s in self.samples for name in s.died]
        if self.budget_s is not None:
            found += [
                f"{1000 * took:.1f} ms, {1000 * (self.budget_s + held):.1f} are allowed"
                for took, held in zip(times(self.samples), self.machine_s, strict=True)
                if took > self.budget_s + held
            ]
        return found


def times(samples: Sequence[Sample]) -> list[float]:
    """Return for each sample how long the board was not told to stop, in seconds.

    Both count: until the first STOP or BREAK, and until the last command to move.
    """
    return [max(math.inf if s.told_s is None else s.told_s, s.moved_s) for s in samples]


def rank(values: Sequence[float], share: float) -> float:
    """Return the value that this share of them does not exceed (nearest rank)."""
    return sorted(values)[max(0, math.ceil(share * len(values)) - 1)]


def markdown(rows: Sequence[Row]) -> str:
    """Return the rows as a table."""
    lines = [
        "| fault | n | budget | p50 | p99 | worst | held up | then | |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    return "\n".join(lines + [_line(row) for row in rows]) + "\n"


def verdict(wrong: Sequence[str]) -> str:
    """Return the last line of the document: which rows are wrong, by name."""
    if not wrong:
        return "All are as they should be."
    return f"Not as it should be: {', '.join(wrong)}."


def renewed(document: str, rows: Sequence[Row], date: str) -> str:
    """Return a document with some of its rows measured again; it says which."""
    anew = {row.name: _line(row) for row in rows}
    lines = [anew.get(_name(line), line) for line in document.splitlines()]
    known = {_name(line) for line in lines}
    end = max(number for number, line in enumerate(lines) if line.startswith("| ")) + 1
    lines[end:end] = [line for name, line in anew.items() if name not in known]
    wrong = [_name(line) for line in lines if line.endswith("| WRONG |")]
    again = f"Measured again by themselves on {date}: {', '.join(anew)}."
    return "\n".join([*lines[:-1], again, "", verdict(wrong), ""])


def _name(line: str) -> str:
    return line.split(" | ")[0].removeprefix("| ")


def _line(row: Row) -> str:
    took = times(row.samples)
    timed = row.budget_s is not None
    figures = [_ms(rank(took, share)) if timed else "" for share in (0.5, 0.99, 1.0)]
    outcomes = Counter(sample.outcome or "would not drive again" for sample in row.samples)
    then = ", ".join(name if n == len(took) else f"{name} {n}" for name, n in outcomes.items())
    cells = [
        row.name, str(len(took)), _ms(row.budget_s) if row.budget_s is not None else "", *figures,
        _ms(max(row.machine_s)), then, "WRONG" if row.faults else "ok",
    ]  # fmt: skip
    return f"| {' | '.join(cells)} |"


def _ms(seconds: float) -> str:
    return f"{1000 * seconds:.1f} ms" if math.isfinite(seconds) else "never"
