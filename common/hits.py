"""Bumper hits on a screen: the bridge and safety each publish an event of one press. Pure."""

from collections import deque
from dataclasses import dataclass, field

from common.freshness import NS_PER_S
from t2.messages import Event

HIT_NS = NS_PER_S // 2  # between both events of one press, on the clock of their host
HITS_MAX = 64  # more than a history has


@dataclass
class Hits:
    """The events of hits that a screen has shown, and whose second one is still to come."""

    _shown: deque[tuple[str, Event]] = field(default_factory=lambda: deque(maxlen=HITS_MAX))

    def is_repeat(self, service: str, event: Event) -> bool:
        """Return whether this event is the second one of a hit, from the other service."""
        if event.name != "contact":
            return False
        for other, first in self._shown:
            is_near = abs(event.mono_ns - first.mono_ns) <= HIT_NS
            if other != service and first.host == event.host and is_near:
                self._shown.remove((other, first))
                return True
        self._shown.append((service, event))
        return False
