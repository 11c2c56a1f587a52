"""What goes wrong in a soak: faults drawn at random, the same ones for the same seed.

Each kind comes once before any comes again, in an order of its own, so that a short soak meets them
all. A fault begins, lasts, and is undone; in some of them the vehicle must stand after a short
while and until the end.
"""

from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from typing import Literal, get_args

from sim import requests as q

PAUSE_S = (3.0, 7.0)  # between the end of a fault and the next one
WELL = q.Wire()


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing that goes wrong: something done to the vehicle, or a service killed with -9."""

    name: str
    seconds: float  # that it lasts; a killed service is left dead for so long
    begin: q.Asked | None = None
    end: q.Asked | None = None  # undoes it; None when it ends by itself
    kills: str = ""  # the service
    still: bool = False  # whether the vehicle must not be moved while it lasts


DIRECTIONS: tuple[Literal["to_pc", "to_board", "both"], ...] = ("to_pc", "to_board", "both")
SIDES: tuple[Literal["left", "right"], ...] = ("left", "right")

Draw = Callable[[Random], Fault]


class Faults:
    """Hands out one fault after the other."""

    def __init__(self, seed: int) -> None:
        self._random = Random(seed)
        self._bag: list[tuple[str, Draw]] = []

    def next(self, kills: bool) -> Fault:
        """Return the next fault; with ``kills`` False one that leaves all processes alive."""
        while True:
            if not self._bag:
                self._bag = list(KINDS.items())
                self._random.shuffle(self._bag)
            name, draw = self._bag.pop()
            if kills or not name.startswith("kill "):
                return draw(self._random)

    def pause_s(self) -> float:
        """Return how long all is well before the next one."""
        return self._random.uniform(*PAUSE_S)

    def one_of(self, count: int) -> int:
        """Draw a number from zero to ``count`` - 1."""
        return self._random.randrange(count)


def _lasts(random: Random) -> float:
    return random.uniform(1.0, 4.0)


def _wire(name: str, **chances: float) -> tuple[str, Draw]:
    def draw(random: Random) -> Fault:
        direction = random.choice(DIRECTIONS)
        wire = q.Wire(direction=direction, **chances)
        return Fault(f"wire {name}", _lasts(random), wire, WELL)

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
        _kill("sim", still=False),  # a board that is dead holds no command
        _kill("odom", still=False),  # safety needs no odometry; the operator stops without it
    ]
)
