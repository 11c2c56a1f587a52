"""What a robot's router sends to laptops: their link may be thin, and what drives comes first.

Streams that are faster than a laptop needs are thinned on their way out, by Zenoh's own
``downsampling``: it counts on each link for itself, and lets the newest through when it is due. The
state, events, answers and all that comes *from* laptops are untouched, and so is whatever moves
on board: only links of ``PROTOCOLS`` are thinned, and services on board never dial these.
"""

from collections.abc import Sequence
from math import ceil
from typing import Any

from common.keys import FAST, MOTION, TOPICS, Topic

PROTOCOLS = ("tls", "quic")


def thinned(robot: str, rate_hz: float, protocols: Sequence[str] = PROTOCOLS) -> dict[str, Any]:
    """Return the part of a router's configuration that lets at most so many a second through.

    Time is counted for each rule, not for each key: a rule is of one robot.
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
    """Tell whether laptops only look at it: a motion commands the bridge and nobody else."""
    return topic.service is FAST or topic is MOTION


def _freq_hz(given_hz: float, wanted_hz: float) -> float:
    """Return what to ask of Zenoh, so that every so manieth passes even when it comes early.

    Zenoh lets one through when 1 / freq is over: at just the wanted rate, one that is early by a
    hair is held back, and the next one is a whole period late.
    """
    every = ceil(given_hz / wanted_hz)
    return given_hz / (every - 0.5)
