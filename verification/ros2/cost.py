"""``python -m verification.ros2.cost``: CPU of the gateway, and the time it adds to a command.

Two sources request the same motions in turns, each request with a speed of its own: one on the bus,
``@cmd/drive/nav``, and one on ``cmd_vel``. The simulated board records when the RUN frame with that
speed arrives. The CPU time is that of the gateway's process while a node subscribes to all topics.
"""

import argparse
import itertools
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import zenoh

from common import child_process, clock
from common.bus.bus import Bus
from common.bus.session import client_config
from common.loop import Loop
from common.source import DriveSource
from services.ros2 import cdr, names
from services.ros2.attachment import Attachment
from verification.harness.bus import at, bus_on, running, set_options
from verification.harness.process_stats import stat
from verification.harness.stack import RunningStack, running_stack
from verification.harness.waiting import wait_until

STAMPED = "geometry_msgs/msg/TwistStamped"
GID = bytes(range(16))
PERIOD_S, NEUTRAL_S = 0.05, 1.5
# A frame has the requested speed at once instead of a step of the ramp.
STEEP = (
    "safety.linear_acceleration=10.0",
    "safety.deceleration=10.0",
    'safety.unsafe_overrides=["linear_acceleration", "deceleration"]',
)
Request = Callable[[float], None]  # m/s


def main() -> int:
    """Measure, and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5, help="turns of each source")
    parser.add_argument("--requests", type=int, default=60, help="requests in a turn")
    parser.add_argument("--seconds", type=float, default=20.0, help="of each CPU measurement")
    options = parser.parse_args()
    with (
        tempfile.TemporaryDirectory() as folder,
        stack(Path(folder)) as it,
        zenoh.open(client_config(at(it.endpoint))) as session,
    ):
        alone = cpu(it, options.seconds)
        received = session.declare_subscriber("0/**", lambda _: None)
        subscribed = cpu(it, options.seconds)
        received.undeclare()
        with sources(it, session) as both:
            delays = measured(it, both, options.rounds, options.requests)
    print(f"gateway CPU, nobody subscribed  {100 * alone:5.1f} % of a core")
    print(f"gateway CPU, all topics         {100 * subscribed:5.1f} % of a core")
    medians = {}
    for name, values in delays.items():
        medians[name] = statistics.median(values)
        p99 = statistics.quantiles(values, n=100)[98]
        print(f"{name:<20} p50 {medians[name]:6.2f} ms  p99 {p99:6.2f} ms  {len(values)} requests")
    print(f"cmd_vel adds {medians['cmd_vel'] - medians['@cmd/drive/nav']:.2f} ms at p50")
    return 0


@contextmanager
def stack(folder: Path) -> Iterator[RunningStack]:
    """Run the stack with the gateway."""

    def gateway(config: Any) -> dict[str, list[str]]:
        options = set_options(f"bus.connect={config.bus.endpoints[0]}")
        return {"ros2": list(child_process.command("services.ros2", *options))}

    with running_stack(folder, sets=STEEP, beside=gateway) as it:
        time.sleep(3.0)
        yield it


def cpu(it: RunningStack, seconds: float) -> float:
    """Return the CPU time of the gateway as a share of one core."""
    pid = it.processes["ros2"].pid
    before_s, began_s = stat(pid).cpu_s, time.monotonic()
    time.sleep(seconds)
    return (stat(pid).cpu_s - before_s) / (time.monotonic() - began_s)


@contextmanager
def sources(it: RunningStack, session: zenoh.Session) -> Iterator[dict[str, Request]]:
    """Yield a source on the bus and one on ``cmd_vel``."""
    made: list[DriveSource] = []
    sequence = itertools.count(1)
    publisher = session.declare_publisher(names.data_key(0, "/cmd_vel", STAMPED), express=True)

    def declare(bus: Bus) -> None:
        made.append(DriveSource(bus, "nav"))

    def command(linear: float) -> None:
        about = Attachment(next(sequence), time.time_ns(), GID)
        twist = ((linear, 0.0, 0.0), (0.0, 0.0, 0.0))
        publisher.put(cdr.encode(STAMPED, (((0, 0), ""), twist)), attachment=about.encode())

    with running(Loop()) as loop, bus_on(it.endpoint, loop, declare):

        def drive(linear: float) -> None:
            loop.post(lambda: _requested(made[0], linear))

        yield {"@cmd/drive/nav": drive, "cmd_vel": command}


def _requested(source: DriveSource, linear: float) -> None:
    source.request(linear, 0.0)


def measured(
    it: RunningStack, both: dict[str, Request], rounds: int, requests: int
) -> dict[str, list[float]]:
    """Return the times in ms from each request to its RUN frame, by source, in turns."""
    delays: dict[str, list[float]] = {name: [] for name in both}
    for _ in range(rounds):
        for name, request in both.items():
            for _ in range(round(NEUTRAL_S / PERIOD_S)):
                request(0.0)
                time.sleep(PERIOD_S)
            sent = {}
            for number in range(requests):
                speed = round(0.1 + 0.002 * (number % 50), 3) * (-1) ** (number // 50)
                sent[speed] = clock.now_ns()
                request(speed)
                time.sleep(PERIOD_S)
                if number % 50 == 49:
                    delays[name] += found(it, sent)
                    sent.clear()
            delays[name] += found(it, sent)
            request(0.0)
            wait_until(lambda: it.speed() == 0, "a standstill")
            time.sleep(1.0)
    return delays


def found(it: RunningStack, sent: dict[float, int]) -> list[float]:
    """Return the time in ms of each speed from its request to its first frame after that."""
    made = [each for each in it.trace().commands if each.kind == "run"]
    delays = []
    for speed, sent_ns in sent.items():
        frames = [
            each.mono_ns for each in made
            if each.mono_ns >= sent_ns and abs(each.linear - speed) < 0.0005
        ]  # fmt: skip
        if frames:
            delays.append((min(frames) - sent_ns) / 1e6)
    return delays


if __name__ == "__main__":
    sys.exit(main())
