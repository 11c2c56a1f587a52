"""Rows of the fault campaign, their verdict and the table. Pure."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from verification.faults.trial import Sample
from verification.harness.results import percentile, table

HEAD = "fault", "n", "budget", "p50", "p99", "worst", "stall", "then", ""


@dataclass(frozen=True, slots=True)
class Row:
    """One fault and its trials."""

    name: str
    budget_s: float | None
    outcomes: Sequence[str]  # allowed
    samples: Sequence[Sample]
    stalls_s: Sequence[float]  # longest stall of the host during each sample

    @property
    def allowance_s(self) -> list[float]:
        """Time that the host took in each sample: a stall, or ending a killed process."""
        return [
            stall + sample.death_s
            for stall, sample in zip(self.stalls_s, self.samples, strict=True)
        ]

    @property
    def faults(self) -> list[str]:
        """Return the violations."""
        found = [
            f"{sample.outcome or 'does not drive again'}, not {' or '.join(self.outcomes)}"
            for sample in self.samples
            if sample.outcome not in self.outcomes
        ]
        found += ["a motion command without a request" for s in self.samples if s.unrequested]
        found += [f"{name} ended" for s in self.samples for name in s.ended]
        if self.budget_s is not None:
            found += [
                f"{1000 * took:.1f} ms, {1000 * (self.budget_s + allowance):.1f} are allowed"
                for took, allowance in zip(times(self.samples), self.allowance_s, strict=True)
                if took > self.budget_s + allowance
            ]
        return found


def times(samples: Sequence[Sample]) -> list[float]:
    """Return the reaction time of each sample, in seconds.

    It is the later one of the first STOP or BRAKE and the last command that moves the vehicle.
    """
    return [max(math.inf if s.stopped_s is None else s.stopped_s, s.moved_s) for s in samples]


def markdown(rows: Sequence[Row]) -> str:
    """Return the table of the rows."""
    return table(HEAD, map(_cells, rows)) + "\n"


def verdict(wrong: Sequence[str]) -> str:
    """Return the last line of the document, which names the wrong rows."""
    if not wrong:
        return "All rows are within their limits."
    return f"Outside their limits: {', '.join(wrong)}."


def renewed(document: str, rows: Sequence[Row], date: str) -> str:
    """Return a document with some of its rows replaced and named."""
    replaced = {row.name: markdown([row]).splitlines()[-1] for row in rows}
    lines = [replaced.get(_name(line), line) for line in document.splitlines()]
    known = {_name(line) for line in lines}
    end = max(number for number, line in enumerate(lines) if line.startswith("| ")) + 1
    lines[end:end] = [line for name, line in replaced.items() if name not in known]
    wrong = [_name(line) for line in lines if line.endswith("| WRONG |")]
    again = f"Measured again separately on {date}: {', '.join(replaced)}."
    return "\n".join([*lines[:-1], again, "", verdict(wrong), ""])


def _name(line: str) -> str:
    return line.split(" | ")[0].removeprefix("| ")


def _cells(row: Row) -> list[str]:
    took = times(row.samples)
    timed = row.budget_s is not None
    figures = [_ms(percentile(took, share)) if timed else "" for share in (0.5, 0.99, 1.0)]
    outcomes = Counter(sample.outcome or "does not drive again" for sample in row.samples)
    then = ", ".join(name if n == len(took) else f"{name} {n}" for name, n in outcomes.items())
    return [
        row.name, str(len(took)), _ms(row.budget_s) if row.budget_s is not None else "", *figures,
        _ms(max(row.allowance_s)), then, "WRONG" if row.faults else "ok",
    ]  # fmt: skip


def _ms(seconds: float) -> str:
    return f"{1000 * seconds:.1f} ms" if math.isfinite(seconds) else "never"
