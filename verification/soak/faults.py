"""Random faults of a soak, reproducible by their seed.

Each kind is drawn once, in random order, before any kind is drawn again, so that a short soak has
all kinds. A fault begins, lasts, and is removed. During some faults the vehicle must stand after a
short time and until the end.
"""

from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from typing import Literal, get_args

from msgspec.structs import replace

from sim import requests as q

PAUSE_S = (3.0, 7.0)  # between the end of a fault and the next one
NO_FAULT = q.Wire()


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault: a request to the simulated vehicle, or SIGKILL of a service."""

    name: str
    seconds: float  # duration; a killed service is not restarted meanwhile
    begin: q.Asked | None = None
    end: q.Asked | None = None  # removes the fault; None when it ends by itself
    kills: str = ""  # the service
    still: bool = False  # whether the vehicle must stand during the fault


DIRECTIONS: tuple[Literal["to_pc", "to_board", "both"], ...] = ("to_pc", "to_board", "both")
SIDES: tuple[Literal["left", "right"], ...] = ("left", "right")

Draw = Callable[[Random], Fault]


class Faults:
    """Draws the faults."""

    def __init__(self, seed: int) -> None:
        self._random = Random(seed)
        self._remaining: list[tuple[str, Draw]] = []

    def next(self, kills: bool) -> Fault:
        """Return the next fault; without ``kills`` one that kills no process."""
        while True:
            if not self._remaining:
                self._remaining = list(KINDS.items())
                self._random.shuffle(self._remaining)
            name, draw = self._remaining.pop()
            if kills or not name.startswith("kill "):
                return draw(self._random)

    def pause_s(self) -> float:
        """Return the pause before the next fault."""
        return self._random.uniform(*PAUSE_S)

    def one_of(self, count: int) -> int:
        """Draw a number from zero to ``count`` - 1."""
        return self._random.randrange(count)


def _lasts(random: Random) -> float:
    return random.uniform(1.0, 4.0)


def _wire(name: str, **chances: float) -> tuple[str, Draw]:
    def draw(random: Random) -> Fault:
        direction = random.choice(DIRECTIONS)
        wire = replace(q.Wire(direction=direction), **chances)
        return Fault(f"wire {name}", _lasts(random), wire, NO_FAULT)

    return f"wire {name}", draw


def _kill(service: str, still: bool) -> tuple[str, Draw]:
    name = f"kill {service}"
    return name, lambda random: Fault(name, _lasts(random), kills=service, still=still)


def _freeze(random: Random) -> Fault:
    seconds = random.uniform(0.1, 3.0)
    return Fault("freeze", seconds, q.Freeze(seconds=seconds))


def _power_cycle(random: Random) -> Fault:
    seconds = _lasts(random)
    return Fault("power cycle", seconds, q.PowerCycle(seconds=seconds))


def _sonar(random: Random) -> Fault:
    sonar: q.SonarName = random.choice(get_args(q.SonarName))
    return Fault(
        "sonar fault", _lasts(random), q.Sonar(name=sonar, fault=True), q.Sonar(name=sonar)
    )


def _driver(random: Random) -> Fault:
    side = random.choice(SIDES)
    bits = 1 << random.randrange(5)  # those that the manual names
    begin, end = q.Driver(side=side, bits=bits), q.Driver(side=side, bits=0)
    return Fault("driver fault", _lasts(random), begin, end, still=True)


KINDS: dict[str, Draw] = dict(
    [
        _wire("drop", drop=0.3),
        _wire("duplicate", duplicate=0.5),
        _wire("reorder", reorder=0.3),
        _wire("corrupt", corrupt=0.2),
        _wire("delay", delay=0.08, jitter=0.05),
        ("freeze", _freeze),
        ("power cycle", _power_cycle),
        ("sonar fault", _sonar),
        ("driver fault", _driver),
        _kill("safety", still=True),
        _kill("bridge", still=True),
        _kill("driver", still=True),
        _kill("router", still=True),
        _kill("sim", still=False),  # a dead board holds no command
        _kill("odom", still=False),  # safety needs no odometry; the driver stops without it
    ]
)
