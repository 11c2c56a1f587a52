"""Random faults of a soak, reproducible by their seed."""

from collections.abc import Iterator
from random import Random
from typing import Literal, NamedTuple, get_args

from msgspec.structs import replace

from sim import requests as q

DIRECTIONS: tuple[Literal["to_pc", "to_board", "both"], ...] = ("to_pc", "to_board", "both")
WIRE = {
    "drop": q.Wire(drop=0.3),
    "duplicate": q.Wire(duplicate=0.5),
    "reorder": q.Wire(reorder=0.3),
    "corrupt": q.Wire(corrupt=0.2),
    "delay": q.Wire(delay=0.08, jitter=0.05),
}
KILLED = "router", "safety", "bridge", "bridge/1", "driver", "sim", "odom"  # bridge/1: its child


class Fault(NamedTuple):
    """One fault: a request to the simulated vehicle, or SIGKILL of a process."""

    name: str
    seconds: float  # duration; a killed process is not restarted meanwhile
    begin: q.Asked | None = None
    end: q.Asked | None = None  # removes the fault; None when it ends by itself
    kills: str = ""  # the process


def faults(random: Random) -> Iterator[Fault]:
    """Yield faults without end: each kind once, in random order, then all of them again."""
    while True:
        drawn = one_of_each(random)
        random.shuffle(drawn)
        yield from drawn


def one_of_each(random: Random) -> list[Fault]:
    """Return one fault of each kind."""

    def seconds() -> float:
        return random.uniform(1.0, 4.0)

    frozen_s, off_s = random.uniform(0.1, 3.0), seconds()
    sonar: q.SonarName = random.choice(get_args(q.SonarName))
    bits = 1 << random.randrange(5)  # those that the manual names
    cable = {
        name: replace(wire, direction=random.choice(DIRECTIONS)) for name, wire in WIRE.items()
    }
    return [
        *(Fault(f"wire {name}", seconds(), wire, q.Wire()) for name, wire in cable.items()),
        Fault("freeze", frozen_s, q.Freeze(seconds=frozen_s)),
        Fault("power cycle", off_s, q.PowerCycle(seconds=off_s)),
        Fault("sonar fault", seconds(), q.Sonar(name=sonar, fault=True), q.Sonar(name=sonar)),
        Fault("driver fault", seconds(), q.Driver(side="left", bits=bits),
              q.Driver(side="left", bits=0)),
        *(Fault(f"kill {name}", seconds(), kills=name) for name in KILLED),
    ]  # fmt: skip
