"""Rows of the fault campaign, their verdict and the page. Pure."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median_low

from verification.faults.fault import Fault, Outcome
from verification.harness.results import table

HEAD = "fault", "n", "budget", "median", "worst", "stall", "then", "date", ""
PAGE = """# Faults

`make faults` renews this page; last run: {machine}. Real processes, real UDP, the simulated board,
0.8 m/s on an empty plane while motion is requested.

- *median, worst*: time from the fault to the last command at the board that moves the vehicle, or
  to the first STOP or BRAKE if that is later.
- *stall*: the longest time that the host kept a sleeping process from running during a sample, plus
  the time that the kernel took to end a killed process. A sample may exceed its budget by it.
- *then*: what it takes to drive again after the fault.

{table}
{left_out}
{verdict}
"""


@dataclass(frozen=True, slots=True)
class Sample:
    """The result of a trial."""

    stopped_s: float | None  # until the first STOP or BRAKE
    moved_s: float  # until the last command that moves the vehicle, while the fault lasted
    outcome: Outcome | None  # None: it does not drive again
    fault_ns: int
    unrequested: bool = False  # a motion command that no driver requested
    ended: tuple[str, ...] = ()  # processes that had to survive
    death_s: float = 0.0  # that the kernel took to end the killed process

    @property
    def reaction_s(self) -> float:
        """The later one of the first STOP or BRAKE and the last command that moves the vehicle."""
        return max(math.inf if self.stopped_s is None else self.stopped_s, self.moved_s)


@dataclass(frozen=True, slots=True)
class Row:
    """One fault and its trials."""

    fault: Fault
    budget_s: float | None
    samples: Sequence[Sample]
    stalls_s: Sequence[float]  # longest stall of the host during each sample

    @property
    def allowances_s(self) -> list[float]:
        """Time that the host took in each sample: a stall, or ending a killed process."""
        pairs = zip(self.samples, self.stalls_s, strict=True)
        return [stall + sample.death_s for sample, stall in pairs]

    @property
    def violations(self) -> list[str]:
        """Return the violations of all samples."""
        allowed = " or ".join(self.fault.outcome)
        found = [
            f"{sample.outcome or 'does not drive again'}, not {allowed}"
            for sample in self.samples
            if sample.outcome not in self.fault.outcome
        ]
        found += ["a motion command without a request" for s in self.samples if s.unrequested]
        found += [f"{name} ended" for s in self.samples for name in s.ended]
        if self.budget_s is not None:
            found += [
                f"{_ms(sample.reaction_s)}, {_ms(self.budget_s + allowance_s)} are allowed"
                for sample, allowance_s in zip(self.samples, self.allowances_s, strict=True)
                if sample.reaction_s > self.budget_s + allowance_s
            ]
        return found

    def line(self, date: str) -> str:
        """Return the row of the page's table."""
        times = ["", "", ""]
        if self.budget_s is not None:
            took = [sample.reaction_s for sample in self.samples]
            times = [_ms(self.budget_s), _ms(median_low(took)), _ms(max(took))]
        count = len(self.samples)
        outcomes = Counter(sample.outcome or "does not drive again" for sample in self.samples)
        then = ", ".join(name if n == count else f"{name} {n}" for name, n in outcomes.items())
        cells = [
            self.fault.name, str(count), *times, _ms(max(self.allowances_s)), then, date,
            "WRONG" if self.violations else "ok",
        ]  # fmt: skip
        return f"| {' | '.join(cells)} |"


def lines_of(page: str) -> dict[str, str]:
    """Return the rows of a page's table by name."""
    lines = [line for line in page.splitlines() if line.startswith("| ")]
    return {line.split(" | ")[0].removeprefix("| "): line for line in lines[2:]}


def render(machine: str, lines: Mapping[str, str], left_out: Iterable[str]) -> str:
    """Return the page with these rows."""
    wrong = [name for name, line in lines.items() if line.endswith("| WRONG |")]
    return PAGE.format(
        machine=machine,
        table="\n".join([table(HEAD, []), *lines.values()]),
        left_out="".join(f"\nLeft out: {one}.\n" for one in left_out),
        verdict=f"Outside their limits: {', '.join(wrong)}."
        if wrong
        else "All rows are within their limits.",
    )


def _ms(seconds: float) -> str:
    return f"{1000 * seconds:.1f} ms" if math.isfinite(seconds) else "never"
