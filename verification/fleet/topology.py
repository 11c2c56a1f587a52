"""The ground that a fleet is measured on: a site's router, real stacks, light robots."""

import contextlib
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from verification.faults.stack_fixture import QUICK
from verification.fleet.child_process import Part
from verification.fleet.figures import Asked, Window, answers_s
from verification.fleet.resource_usage import Usage, connections, since, usage
from verification.harness.bus import router_process
from verification.harness.ports import free_port
from verification.harness.process_stats import Machine, machine
from verification.harness.stack import RunningStack, running_stack
from verification.harness.trace import TraceFollower

SETTLE_S = 3.0  # until declarations are known and queues are empty
ANSWER_S = 1.0  # until the last request is answered
REAL = 2


@dataclass
class Ground:
    """What runs."""

    site: str
    site_pid: int
    stacks: list[RunningStack] = field(default_factory=list)
    light: Part | None = None
    light_count: int = 0

    @property
    def port(self) -> int:
        """The site router's."""
        return int(self.site.rpartition(":")[2])

    def pids(self) -> dict[str, list[int]]:
        """Return who runs, by what it is."""
        mine = {"site": [self.site_pid], "light": [self.light.pid] if self.light else []}
        for number, stack in enumerate(self.stacks):
            processes = {name: [it.pid] for name, it in stack.processes.items()}
            mine[f"router {number}"] = processes.pop("router")
            mine[f"stack {number}"] = [pid for each in processes.values() for pid in each]
        return mine


@dataclass(frozen=True, slots=True)
class Reading:
    """All gauges at one moment."""

    at_s: float
    used: dict[str, Usage]
    machine: Machine
    links: dict[int, dict[str, int]]


def read(ground: Ground, others: dict[str, list[int]]) -> Reading:
    """Read them."""
    pids = ground.pids() | others
    return Reading(
        time.monotonic(),
        {who: usage(each) for who, each in pids.items()},
        machine(),
        connections(ground.port),
    )


@contextlib.contextmanager
def site() -> Iterator[Ground]:
    """Run the site's router while the context lasts."""
    where = f"tcp/127.0.0.1:{free_port()}"
    with router_process(where) as process:
        yield Ground(where, process.pid)


@contextlib.contextmanager
def stack(ground: Ground, folder: Path) -> Iterator[RunningStack]:
    """Run a real robot, whose own router dials the site's, while the context lasts."""
    number = len(ground.stacks)
    room = folder / f"robot{number}"
    room.mkdir(parents=True)
    sets = [f"robot.id={robot(number)}", f"bus.uplink={ground.site}", *QUICK]
    with running_stack(room, sets=sets, shipped=True) as made:
        ground.stacks.append(made)
        try:
            yield made
        finally:
            ground.stacks.remove(made)


@contextlib.contextmanager
def crowd(ground: Ground, robots: int, shape: str, thin: float) -> Iterator[None]:
    """Let light robots make up the number while the context lasts."""
    names = [robot(number) for number in range(len(ground.stacks), robots)]
    if not names:
        yield
        return
    words = [
        "verification.fleet.simulated_robot",
        ground.site,
        *names,
        "--shape",
        shape,
        "--thin",
        str(thin),
    ]
    with Part(*words) as part:
        ground.light, ground.light_count = part, len(names)
        try:
            yield
        finally:
            ground.light, ground.light_count = None, 0


def robot(number: int) -> str:
    """Return the name of a robot, from 0 on."""
    return f"berlin-{number + 1:03d}"


def window(ground: Ground, what: str, seconds: float, endpoint: str) -> Window:
    """Measure for so long while somebody looks at this and one real robot is driven."""
    frames = TraceFollower(ground.stacks[0].trace_file)
    hand_words = ("verification.fleet.source", endpoint, robot(0))
    with Part("verification.fleet.subscriber", ground.site, what) as ear, Part(*hand_words) as hand:
        time.sleep(SETTLE_S)
        parts = [part for part in (ground.light, ear, hand) if part]
        others = {"ear": [ear.pid], "hand": [hand.pid]}
        for part in parts:
            part.begin()
        frames.follow().forget()
        before = read(ground, others)
        time.sleep(seconds)
        after = read(ground, others)
        told = [part.end() for part in parts]
        time.sleep(ANSWER_S)
        commands = frames.follow().commands
    light = told[0] | {"robots": ground.light_count} if ground.light else None
    asked = [Asked(*each) for each in told[-1]["asked"]]
    return {
        "robots": len(ground.stacks) + ground.light_count,
        "what": what,
        "light": light,
        "ear": told[-2],
        "refused": told[-1]["refused"],
        "answers_s": answers_s(asked, commands),
    } | gauged(ground, before, after)


def gauged(ground: Ground, before: Reading, after: Reading) -> Window:
    """Return what the gauges tell of the time between two readings."""
    past_s = after.at_s - before.at_s
    parts = {
        who: {"cpu": (now.cpu_s - before.used[who].cpu_s) / past_s, "rss": now.rss}
        for who, now in after.used.items()
    }
    mine_s = past_s * sum(part["cpu"] for part in parts.values())
    whole = [getattr(after.machine, f) - getattr(before.machine, f) for f in FIELDS]
    rates = {pid: since(now, before.links.get(pid, {}), past_s) for pid, now in after.links.items()}
    light = rates.get(ground.light.pid) if ground.light else None
    count = ground.light_count
    router = ground.stacks[0].processes["router"].pid
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
        "light_total": _each(after.links.get(ground.light.pid), count) if ground.light else None,
        "light_link": _each(light, count),
    }


def _each(sums: Mapping[str, float] | None, count: int) -> dict[str, float] | None:
    return {name: total / count for name, total in sums.items()} if sums else None


FIELDS: Sequence[str] = ("busy_s", "idle_s", "stolen_s")
