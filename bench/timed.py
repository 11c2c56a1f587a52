"""``python -m bench.timed SERVICE FILE ...``: a service that writes how long its functions took.

At the end FILE has the durations by function, in ns, and the time from the first call to the last
one. The bridge runs without guard; nothing else differs. Some decisions are taken once more, at
once and without effect: then their code and data are in the caches.
"""

import sys
import time
from collections import defaultdict
from collections.abc import Callable, Mapping
from functools import wraps
from pathlib import Path
from typing import Any

import msgspec

from common import realtime
from common.bus.publisher import Publisher
from common.freshness import NS_PER_S
from common.service import run
from services.bridge.bridge import Bridge
from services.bridge.config import BridgeConfig
from services.bridge.udp import Sockets
from services.odom.config import OdomConfig
from services.odom.odometer import Odometer
from services.safety.__main__ import build
from services.safety.config import SafetyConfig
from services.safety.core.policy import Policy
from services.safety.service import SafetyService

# Some are parts of others.
TIMED: Mapping[str, tuple[tuple[Any, str], ...]] = {
    "bridge": (
        (Bridge, "_read"), (Bridge, "_on_motion"), (Bridge, "_on_tick"), (Sockets, "send"),
        (Publisher, "put"),
    ),
    "safety": (
        (SafetyService, "_on_tick"), (Policy, "decide"), (SafetyService, "_publish_state"),
        (SafetyService, "_on_bumper"), (SafetyService, "_accept"), (Publisher, "put"),
    ),
    "odom": ((Odometer, "_on_mileage"), (Odometer, "_on_velocity"), (Publisher, "put")),
}  # fmt: skip
REPEATED, EACH = "Policy.decide", 25  # the 25th, 50th ...
RUN: Mapping[str, Callable[[list[str]], int]] = {
    "bridge": lambda words: run("bridge", BridgeConfig, Bridge, words, priority=realtime.BRIDGE),
    "safety": lambda words: run("safety", SafetyConfig, build, words, priority=realtime.SAFETY),
    "odom": lambda words: run("odom", OdomConfig, Odometer, words),
}


class Timing(msgspec.Struct):
    """How long the functions of a service took."""

    functions: dict[str, list[int]]  # ns
    span_s: float  # from the first call to the last one


def main(service: str, file: str, *words: str) -> int:
    """Run a service until a signal; return its exit code."""
    durations, ends_ns = defaultdict[str, list[int]](list), list[int]()

    def timed(owner: Any, name: str) -> None:
        function, full_name = getattr(owner, name), f"{owner.__name__}.{name}"
        found = durations[full_name]

        @wraps(function)
        def call(*arguments: Any, **more: Any) -> Any:
            begin_ns = time.perf_counter_ns()
            try:
                return function(*arguments, **more)
            finally:
                end_ns = time.perf_counter_ns()
                found.append(end_ns - begin_ns)
                ends_ns[:] = [ends_ns[0] if ends_ns else begin_ns, end_ns]
                if full_name == REPEATED and len(found) % EACH == 0:
                    function(*arguments, **more)
                    again_ns = time.perf_counter_ns() - end_ns
                    durations[f"{full_name}, once more"].append(again_ns)

        setattr(owner, name, call)

    for owner, name in TIMED[service]:
        timed(owner, name)
    code = RUN[service](list(words))
    timing = Timing(durations, (ends_ns[1] - ends_ns[0]) / NS_PER_S)
    Path(file).write_bytes(msgspec.json.encode(timing))
    return code


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
