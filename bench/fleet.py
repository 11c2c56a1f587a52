"""Cost of N robots behind one site's router, and time of a request over it.

One robot is a real stack with its own router, driven from the site; the others are simulated. All
run on this host, in plain TCP.
"""

import contextlib
import tempfile
import time
from bisect import bisect_left
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path

from bench.load import MARGIN
from bench.series import CPU, MS, ONE, Column, Limits, Series, Unit
from common import keys
from common.freshness import NS_PER_S
from sim.trace import Command
from verification.harness.bus import router_process
from verification.harness.child_process import ChildProcess
from verification.harness.ports import free_port
from verification.harness.process_stats import CpuShares, memory
from verification.harness.stack import RunningStack, running_stack
from verification.harness.trace import TraceFollower

ROBOTS, SECONDS = (1, 10, 50), 6.0
SETTLE_S, ANSWER_S = 2.0, 1.0
OWN_ROUTER = "at its own router"
# Key expressions of the consumer at the site.
CONSUMED = {
    "nothing": (),
    "everything": (f"{keys.ROOT}/*/tel/**", f"{keys.ROOT}/*/evt/*"),
}
PATIENCE_NS = NS_PER_S  # a later frame is not the answer
SAME_MPS = 0.0004  # resolution of the wire: 1 mm/s


def name_of(number: int) -> str:
    """Return the name of a robot, numbered from 1."""
    return f"berlin-{number:03d}"


def measure(robots: Sequence[int] = ROBOTS, seconds: float = SECONDS) -> list[Series]:
    """Return the figures of each number of robots and subscription."""
    site = f"tcp/127.0.0.1:{free_port()}"
    sets = [f"robot.id={name_of(1)}", f"bus.uplink={site}"]
    made: list[Series] = []
    with (
        tempfile.TemporaryDirectory() as folder,
        router_process(site) as router,
        running_stack(Path(folder), sets=sets, shipped=True) as stack,
    ):
        made += window(stack, site, router.pid, ("1", OWN_ROUTER), seconds)
        for count in robots:
            with simulated(site, count):
                for what in CONSUMED:
                    made += window(stack, site, router.pid, (str(count), what), seconds)
    return made


def simulated(site: str, robots: int) -> AbstractContextManager[object]:
    """Run simulated robots for the rest of this number."""
    names = map(name_of, range(2, robots + 1))
    words = "bench.fleet_robots", site, name_of(1), *names
    return ChildProcess(*words) if robots > 1 else contextlib.nullcontext()


def window(
    stack: RunningStack, site: str, pid: int, name: tuple[str, str], seconds: float
) -> list[Series]:
    """Measure with this subscription at the site, while the real robot is driven."""
    endpoint = stack.endpoint if name[1] == OWN_ROUTER else site
    frames = TraceFollower(stack.trace_file)
    with (
        ChildProcess("bench.consumer", site, *CONSUMED.get(name[1], ())) as consumer,
        ChildProcess("bench.client", endpoint, "drive", name_of(1)) as source,
    ):
        time.sleep(SETTLE_S)
        frames.follow().forget()
        consumer.begin()
        source.begin()
        with CpuShares({"site": pid}) as shares:
            time.sleep(seconds)
        came, asked = consumer.end(), source.end()
        time.sleep(ANSWER_S)
    took: Sequence[int | None] = answers_ns(asked, frames.follow().commands)
    figures: dict[str, Sequence[float]] = {
        "site": [shares.ns["site"]],
        "memory": [memory(pid)["rss"]], "arrived": [came["hz"]],
        "bytes": [came["bytes_per_s"] / int(name[0])], "age": came["ages_ns"],
        "request": [ns for ns in took if ns is not None], "unanswered": [took.count(None)],
    }  # fmt: skip
    return [Series(name=(*name, what), samples=values) for what, values in figures.items()]


def answers_ns(
    requests: Sequence[tuple[int, float]], commands: Sequence[Command]
) -> list[int | None]:
    """Return the time from each request to the frame with its speed; None for a missing frame."""
    times = [command.mono_ns for command in commands]
    found: list[int | None] = []
    for at_ns, linear in requests:
        after = commands[bisect_left(times, at_ns) : bisect_left(times, at_ns + PATIENCE_NS)]
        same = (c for c in after if c.kind == "run" and abs(c.linear - linear) < SAME_MPS)
        found.append(next((c.mono_ns - at_ns for c in same), None))
    return found


COLUMNS = (
    Column("arrived /s", "arrived", ONE), Column("of one,", "bytes", Unit("kbit/s", 125)),
    Column("age", "age", MS), Column("site's router", "site", CPU),
    Column("its memory", "memory", Unit("MB", 1e6)), Column("request p50", "request", MS),
    Column("p99", "request", MS, "p99"), Column("unanswered", "unanswered", ONE),
)  # fmt: skip
LIMITS: Limits = [
    (("50", "everything"), ("1", "everything"), COLUMNS[3], 50 * MARGIN),
    (("50", "everything"), ("1", OWN_ROUTER), COLUMNS[5], 3.0),
]
