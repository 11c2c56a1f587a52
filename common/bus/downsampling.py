"""Downsampling of streams from a robot's router to laptops, whose link may be slow.

Zenoh's ``downsampling`` limits the rate on each link and passes the newest sample when one is due.
The state, events, answers and everything *from* laptops are not affected, nor is traffic on board:
only links of ``PROTOCOLS`` are downsampled, and services on board never use these.
"""

from collections.abc import Sequence
from math import ceil
from typing import Any

from common.keys import FAST, MOTION, TOPICS, Topic

PROTOCOLS = ("tls", "quic")


def downsampling_rules(
    robot: str, rate_hz: float, protocols: Sequence[str] = PROTOCOLS
) -> dict[str, Any]:
    """Return the router configuration that limits each stream to ``rate_hz``.

    Zenoh applies a limit per rule, not per key: a rule is for one robot.
    """
    rules = [
        {"key_expr": topic.on(robot), "freq": _freq_hz(topic.rate_hz, rate_hz)}
        for topic in TOPICS
        if _streams(topic) and topic.rate_hz > rate_hz
    ]
    if not rules:
        return {}
    thin = {
        "id": "laptops",
        "link_protocols": list(protocols),
        "flows": ["egress"],
        "messages": ["put"],
        "rules": rules,
    }
    return {"downsampling": [thin]}


def _streams(topic: Topic[Any]) -> bool:
    """Return whether laptops only display a topic; a motion commands only the bridge."""
    return topic.service is FAST or topic is MOTION


def _freq_hz(given_hz: float, wanted_hz: float) -> float:
    """Return the ``freq`` for Zenoh that passes every n-th sample, even with jitter.

    Zenoh passes a sample when 1 / freq has elapsed: at exactly the wanted rate, a sample that is
    slightly early is dropped, and the next one is a whole period late.
    """
    every = ceil(given_hz / wanted_hz)
    return given_hz / (every - 0.5)
