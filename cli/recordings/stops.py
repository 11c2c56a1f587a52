"""The verdicts of safety over time, and the stops that it commanded. Pure.

A stop begins with the first cause that stops the vehicle and ends when none is left. ``no_request``
and ``neutral`` do not count: the vehicle stands because nothing requests motion, or because the
controls must be released first.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

from common.messages import Cause, SafetyState

IDLE = {"no_request", "neutral"}


@dataclass(slots=True)
class Phase:
    """A period of a constant verdict; ``state`` is its first message."""

    begins_s: float
    ends_s: float
    state: SafetyState

    def is_same(self, state: SafetyState) -> bool:
        """Return whether a state differs in nothing that a report shows."""
        first = self.state
        return (
            first.verdict == state.verdict
            and first.latched == state.latched
            and [cause.name for cause in first.causes] == [cause.name for cause in state.causes]
        )


@dataclass(slots=True)
class Stop:
    """A stop of the vehicle."""

    begins_s: float
    ends_s: float
    was_driving: bool  # the vehicle moved before
    verdict: str  # the first one
    reasons: dict[str, str] = field(default_factory=dict)  # text by name, in order of appearance
    latched: dict[str, None] = field(default_factory=dict)  # in order; these needed a reset
    over: bool = False  # it ended before the recording, or safety's messages, ended

    @property
    def lasts_s(self) -> float:
        """Return the duration."""
        return self.ends_s - self.begins_s

    @property
    def ended_by(self) -> str:
        """Return what ended it."""
        if not self.over:
            return "not ended when the recording, or safety's messages, ended"
        return "a reset" if self.latched else "itself"


def add_state(phases: list[Phase], at_s: float, state: SafetyState, gap_s: float) -> None:
    """Add a state to consecutive phases; a phase ends after ``gap_s`` without a message."""
    last = phases[-1] if phases else None
    if last is not None and at_s - last.ends_s <= gap_s:
        last.ends_s = at_s  # a phase that ends lasts until the next state
        if last.is_same(state):
            return
    phases.append(Phase(at_s, at_s, state))


def stops(phases: Iterable[Phase]) -> list[Stop]:
    """Return all stops of a recording."""
    found: list[Stop] = []
    current: Stop | None = None
    driving = False
    for phase in phases:
        causes = stopping_causes(phase.state)
        if current is not None and (not causes or phase.begins_s > current.ends_s):
            current.over = not causes
            current = None
        if causes and current is None:
            current = Stop(phase.begins_s, phase.ends_s, driving, phase.state.verdict)
            found.append(current)
        if current is not None:
            current.ends_s = phase.ends_s
            for cause in causes:
                current.reasons.setdefault(cause.name, cause.text)
            current.latched |= dict.fromkeys(phase.state.latched)
        driving = phase.state.verdict in ("run", "slow")
    return found


def stopping_causes(state: SafetyState) -> list[Cause]:
    """Return the causes that stop the vehicle, without those of an idle vehicle."""
    if state.verdict in ("run", "slow"):
        return []
    return [cause for cause in state.causes if cause.action != "slow" and cause.name not in IDLE]
