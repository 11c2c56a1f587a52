"""The measured fleet: a site's router, real stacks and simulated robots."""

import contextlib
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from verification.faults.stack_fixture import QUICK
from verification.fleet.figures import Request, Window, answers_s
from verification.fleet.resource_usage import Usage, connections, since, usage
from verification.harness.bus import router_process
from verification.harness.child_process import ChildProcess
from verification.harness.ports import free_port
from verification.harness.process_stats import Machine, machine
from verification.harness.stack import RunningStack, running_stack
from verification.harness.trace import TraceFollower

SETTLE_S = 3.0  # until declarations have arrived and queues are empty
ANSWER_S = 1.0  # until the last request is answered
REAL = 2


@dataclass
class Fleet:
    """Running processes of the fleet."""

    site: str
    site_pid: int
    stacks: list[RunningStack] = field(default_factory=list)
    simulated: ChildProcess | None = None
    simulated_count: int = 0

    @property
    def port(self) -> int:
        """Port of the site router."""
        return int(self.site.rpartition(":")[2])

    def pids(self) -> dict[str, list[int]]:
        """Return the pids by name."""
        mine = {
            "site": [self.site_pid],
            "simulated": [self.simulated.pid] if self.simulated else [],
        }
        for number, stack in enumerate(self.stacks):
            processes = {name: [it.pid] for name, it in stack.processes.items()}
            mine[f"router {number}"] = processes.pop("router")
            mine[f"stack {number}"] = [pid for each in processes.values() for pid in each]
        return mine


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Resource usage at one moment."""

    at_s: float
    used: dict[str, Usage]
    machine: Machine
    links: dict[int, dict[str, int]]


def snapshot(fleet: Fleet, others: dict[str, list[int]]) -> Snapshot:
    """Take a snapshot."""
    pids = fleet.pids() | others
    return Snapshot(
        time.monotonic(),
        {who: usage(each) for who, each in pids.items()},
        machine(),
        connections(fleet.port),
    )


@contextlib.contextmanager
def site() -> Iterator[Fleet]:
    """Run the site's router."""
    where = f"tcp/127.0.0.1:{free_port()}"
    with router_process(where) as process:
        yield Fleet(where, process.pid)


@contextlib.contextmanager
def stack(fleet: Fleet, folder: Path) -> Iterator[RunningStack]:
    """Run a real robot, whose router connects to the site's router."""
    number = len(fleet.stacks)
    stack_folder = folder / f"robot{number}"
    stack_folder.mkdir(parents=True)
    sets = [f"robot.id={robot(number)}", f"bus.uplink={fleet.site}", *QUICK]
    with running_stack(stack_folder, sets=sets, shipped=True) as made:
        fleet.stacks.append(made)
        try:
            yield made
        finally:
            fleet.stacks.remove(made)


@contextlib.contextmanager
def simulated_robots(fleet: Fleet, robots: int, shape: str, thin: float) -> Iterator[None]:
    """Run simulated robots for the rest of this number."""
    names = [robot(number) for number in range(len(fleet.stacks), robots)]
    if not names:
        yield
        return
    words = [
        "verification.fleet.simulated_robot",
        fleet.site,
        *names,
        "--shape",
        shape,
        "--thin",
        str(thin),
    ]
    with ChildProcess(*words) as part:
        fleet.simulated, fleet.simulated_count = part, len(names)
        try:
            yield
        finally:
            fleet.simulated, fleet.simulated_count = None, 0


def robot(number: int) -> str:
    """Return the name of a robot, numbered from 0."""
    return f"berlin-{number + 1:03d}"


def window(fleet: Fleet, what: str, seconds: float, endpoint: str) -> Window:
    """Measure with this subscription while one real robot is driven."""
    frames = TraceFollower(fleet.stacks[0].trace_file)
    source_words = ("verification.fleet.source", endpoint, robot(0))
    with (
        ChildProcess("verification.fleet.subscriber", fleet.site, what) as subscriber,
        ChildProcess(*source_words) as source,
    ):
        time.sleep(SETTLE_S)
        parts = [part for part in (fleet.simulated, subscriber, source) if part]
        others = {"subscriber": [subscriber.pid], "source": [source.pid]}
        for part in parts:
            part.begin()
        frames.follow().forget()
        before = snapshot(fleet, others)
        time.sleep(seconds)
        after = snapshot(fleet, others)
        counts = [part.end() for part in parts]
        time.sleep(ANSWER_S)
        commands = frames.follow().commands
    simulated = counts[0] | {"robots": fleet.simulated_count} if fleet.simulated else None
    requests = [Request(*each) for each in counts[-1]["requests"]]
    return {
        "robots": len(fleet.stacks) + fleet.simulated_count,
        "what": what,
        "simulated": simulated,
        "subscriber": counts[-2],
        "refused": counts[-1]["refused"],
        "answers_s": answers_s(requests, commands),
    } | usage_of(fleet, before, after)


def usage_of(fleet: Fleet, before: Snapshot, after: Snapshot) -> Window:
    """Return the usage between two snapshots."""
    past_s = after.at_s - before.at_s
    parts = {
        who: {"cpu": (now.cpu_s - before.used[who].cpu_s) / past_s, "rss": now.rss}
        for who, now in after.used.items()
    }
    mine_s = past_s * sum(part["cpu"] for part in parts.values())
    whole = [getattr(after.machine, f) - getattr(before.machine, f) for f in FIELDS]
    rates = {pid: since(now, before.links.get(pid, {}), past_s) for pid, now in after.links.items()}
    simulated = rates.get(fleet.simulated.pid) if fleet.simulated else None
    count = fleet.simulated_count
    router = fleet.stacks[0].processes["router"].pid
    return {
        "site": parts["site"],
        "parts": parts,
        "machine": {
            "busy": whole[0] / sum(whole),
            "stolen": whole[2] / sum(whole),
            "others": (whole[0] - mine_s) / sum(whole),
        },
        "real_link": rates[router],
        "real_total": after.links[router],
        "simulated_total": _each(after.links.get(fleet.simulated.pid), count)
        if fleet.simulated
        else None,
        "simulated_link": _each(simulated, count),
    }


def _each(sums: Mapping[str, float] | None, count: int) -> dict[str, float] | None:
    return {name: total / count for name, total in sums.items()} if sums else None


FIELDS: Sequence[str] = ("busy_s", "idle_s", "stolen_s")
