"""Phases of constant state, and the stops that safety commanded. Pure.

A stop begins with the first cause that stops the vehicle and ends when none is left. ``no_request``
and ``neutral`` do not count: the vehicle stands because nothing requests motion, or because the
controls must be released first.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from common.messages import Cause, SafetyState

IDLE = {"no_request", "neutral"}
StateT = TypeVar("StateT")


@dataclass(slots=True)
class Period:
    """A part of a recording."""

    begins_s: float
    ends_s: float

    @property
    def lasts_s(self) -> float:
        """Return the duration."""
        return self.ends_s - self.begins_s


@dataclass(slots=True)
class Phase(Period, Generic[StateT]):
    """A period of constant state; ``state`` is its first message."""

    state: StateT


@dataclass(slots=True)
class Phases(Generic[StateT]):
    """Consecutive phases; a phase ends after ``gap_s`` without a message."""

    gap_s: float
    done: list[Phase[StateT]] = field(default_factory=list)
    _value: object = None

    def add(self, at_s: float, value: object, state: StateT) -> None:
        """Add a state; the last phase continues while ``value`` compares equal."""
        last = self.done[-1] if self.done else None
        if last is not None and at_s - last.ends_s <= self.gap_s:
            last.ends_s = at_s  # a phase that ends lasts until the next state
            if value == self._value:
                return
        self._value = value
        self.done.append(Phase(at_s, at_s, state))


@dataclass(slots=True)
class Stop(Period):
    """A stop of the vehicle."""

    was_driving: bool  # the vehicle moved before
    verdict: str  # the first one
    reasons: dict[str, str] = field(default_factory=dict)  # text by name, in order of appearance
    latched: dict[str, None] = field(default_factory=dict)  # in order; these needed a reset
    over: bool = False  # it ended before the recording, or safety's messages, ended

    def add(self, phase: Phase[SafetyState], causes: Iterable[Cause]) -> None:
        """Add a phase to the stop."""
        self.ends_s = phase.ends_s
        for cause in causes:
            self.reasons.setdefault(cause.name, cause.text)
        self.latched |= dict.fromkeys(phase.state.latched)


def stops(phases: Iterable[Phase[SafetyState]]) -> list[Stop]:
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
            current.add(phase, causes)
        driving = phase.state.verdict in ("run", "slow")
    return found


def stopping_causes(state: SafetyState) -> list[Cause]:
    """Return the causes that stop the vehicle, without those of an idle vehicle."""
    if state.verdict in ("run", "slow"):
        return []
    return [cause for cause in state.causes if cause.action != "slow" and cause.name not in IDLE]
