"""What one step came to: an outcome, why in words, and the data behind it."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Outcome = Literal["passed", "failed", "skipped"]
Row = tuple[str, str]  # what was measured, and the value with its unit


@dataclass(frozen=True, slots=True)
class Verdict:
    """The outcome of a step."""

    outcome: Outcome
    text: str
    data: tuple[Row, ...] = ()


def judged(problems: Iterable[str], fine: str, data: Iterable[Row] = ()) -> Verdict:
    """Return ``passed`` with a fine sentence, or ``failed`` with every problem there is."""
    found = [problem for problem in problems if problem]
    return Verdict("failed" if found else "passed", " ".join(found) or fine, tuple(data))
