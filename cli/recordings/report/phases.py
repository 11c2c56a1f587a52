"""For how long something stayed the same. Pure."""

from dataclasses import dataclass, field
from typing import Generic, TypeVar

StateT = TypeVar("StateT")


@dataclass(slots=True)
class Phase(Generic[StateT]):
    """A time in which nothing changed; ``state`` is what was told first."""

    begins_s: float
    ends_s: float
    state: StateT

    @property
    def lasts_s(self) -> float:
        """Return its length."""
        return self.ends_s - self.begins_s


@dataclass(slots=True)
class Phases(Generic[StateT]):
    """Phases as they follow each other; after ``gap_s`` without a word there is none."""

    gap_s: float
    done: list[Phase[StateT]] = field(default_factory=list)
    _same: object = None

    def take(self, at_s: float, same: object, state: StateT) -> None:
        """Take a state; it belongs to the last phase while ``same`` compares equal."""
        last = self.done[-1] if self.done else None
        if last is not None and at_s - last.ends_s <= self.gap_s:
            last.ends_s = at_s  # of one that ends, too: it lasted until this one was told
            if same == self._same:
                return
        self._same = same
        self.done.append(Phase(at_s, at_s, state))
