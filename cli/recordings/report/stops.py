"""When safety stopped the vehicle, and why. Pure.

A stop begins with a reason to stop and ends when none is left. A vehicle that stands because nobody
asks it to move, or that waits for the controls to be released, has no reason of its own.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

from cli.recordings.report.phases import Phase
from common.messages import Cause, SafetyState

IDLE = {"no_request", "neutral"}


@dataclass(slots=True)
class Stop:
    """One of them."""

    begins_s: float
    ends_s: float
    was_driving: bool  # it ended a motion
    verdict: str  # the first one
    reasons: dict[str, str] = field(default_factory=dict)  # by name, in words; as they came
    latched: dict[str, None] = field(default_factory=dict)  # in order; wanted a reset
    over: bool = False  # before the recording, or the word of safety, ended

    @property
    def lasts_s(self) -> float:
        """Return its length."""
        return self.ends_s - self.begins_s

    def take(self, phase: Phase[SafetyState], causes: Iterable[Cause]) -> None:
        """Let a phase belong to it."""
        self.ends_s = phase.ends_s
        for cause in causes:
            self.reasons.setdefault(cause.name, cause.text)
        self.latched |= dict.fromkeys(phase.state.latched)


def stops(phases: Iterable[Phase[SafetyState]]) -> list[Stop]:
    """Return all stops of a recording."""
    found: list[Stop] = []
    now: Stop | None = None
    driving = False
    for phase in phases:
        causes = reasons(phase.state)
        if now is not None and (not causes or phase.begins_s > now.ends_s):
            now.over = not causes
            now = None
        if causes and now is None:
            now = Stop(phase.begins_s, phase.ends_s, driving, phase.state.verdict)
            found.append(now)
        if now is not None:
            now.take(phase, causes)
        driving = phase.state.verdict in ("run", "slow")
    return found


def reasons(state: SafetyState) -> list[Cause]:
    """Return the causes that stop the vehicle, but for those of one that merely stands."""
    if state.verdict in ("run", "slow"):
        return []
    return [cause for cause in state.causes if cause.action != "slow" and cause.name not in IDLE]
