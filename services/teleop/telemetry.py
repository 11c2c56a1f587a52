"""Telemetry of the robot: the newest message of each topic that the screen shows."""

from functools import partial
from typing import Any

from common.bus.bus import Arrival, Bus
from common.freshness import Latest, fresh
from t2 import keys
from t2.messages import SafetyState

# The topics by their names in the view, and how long (s) their last message is shown.
TOPICS: dict[str, tuple[Any, float, str]] = {
    "safety": (keys.SAFETY, 0.5, ""),
    "velocity": (keys.VELOCITY, 0.5, ""),
    "odometry": (keys.ODOMETRY, 0.5, ""),
    "map_pose": (keys.MAP_POSE, 0.5, ""),
    "ultrasonic": (keys.ULTRASONIC, 0.5, ""),
    "bumper": (keys.BUMPER, 0.5, ""),
    "link": (keys.LINK, 1.0, ""),
    "left": (keys.DRIVER, 2.0, "left"),
    "right": (keys.DRIVER, 2.0, "right"),
}


class Telemetry:
    """The newest messages; None for one that is too old to show, or never came."""

    def __init__(self, bus: Bus) -> None:
        self._latest: dict[str, Latest[Any]] = {}  # by the names of TOPICS
        for name, (topic, _, side) in TOPICS.items():
            bus.subscribe(topic, partial(self._on_message, name), side=side)

    def newest(self, name: str, now_ns: int) -> Any:
        """Return the newest message of a topic."""
        latest = self._latest.get(name)
        return latest.value if latest and fresh(latest, now_ns, TOPICS[name][1]) else None

    def state(self, now_ns: int) -> SafetyState | None:
        """Return the newest state of safety."""
        state: SafetyState | None = self.newest("safety", now_ns)
        return state

    def all(self, now_ns: int) -> dict[str, Any]:
        """Return the newest messages by name."""
        return {name: self.newest(name, now_ns) for name in TOPICS}

    def _on_message(self, name: str, arrival: Arrival[Any]) -> None:
        self._latest[name] = Latest(arrival.message, arrival.received_ns)
