"""Where frames were lost. Pure."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

BEHIND_S = 0.2  # a consumer whose last messages are older does not keep up
SLOW = 0.99  # of the requested rate; below this the board was too slow


@dataclass(frozen=True, slots=True)
class Passage:
    """Counts of the frames of one trial."""

    sent: int
    dropped: int  # by the kernel: the bridge's socket had no room
    published: int  # by the bridge
    received: Sequence[int]  # by each consumer
    late_s: float = 0.0  # age of the messages, all or the last
    pace: float = 1.0  # reached share of the requested rate

    @property
    def losses(self) -> dict[str, int]:
        """Return the losses by place; frames that all consumers miss were lost before them."""
        missing = [self.published - each for each in self.received]
        shared, unread = min(missing), self.sent - self.published
        dropped = min(self.dropped, unread)  # the kernel's count includes answers
        lost = {
            "in the socket": dropped,
            "in the bridge": unread - dropped,
            "between bridge and consumers": shared,
            "at single consumers": sum(missing) - shared * len(missing),
        }
        return {place: count for place, count in lost.items() if count}

    @property
    def words(self) -> str:
        """Describe losses, delay and a slow board; empty without any."""
        found = [f"{count:,} {place}" for place, count in self.losses.items()]
        if self.late_s > BEHIND_S:
            found.append(f"{self.late_s:.1f} s behind")
        if self.pace < SLOW:
            found.append(f"the board was at {self.pace:.0%} of it")
        return ", ".join(found)


def highest(rates: Sequence[int], holds: Callable[[int], bool]) -> int:
    """Return the highest of rising rates that holds, by bisection; 0 where none does."""
    low, high = -1, len(rates)
    while high - low > 1:
        middle = (low + high) // 2
        if holds(rates[middle]):
            low = middle
        else:
            high = middle
    return rates[low] if low >= 0 else 0
