"""Conditions of the link between the two hosts."""

from collections.abc import Sequence
from dataclasses import dataclass

from sim.requests import Wire


@dataclass(frozen=True, slots=True)
class Condition:
    """Constant link faults while a key is held."""

    name: str
    faults: Sequence[Wire] = ()
    downsampled: bool = True  # as shipped; False: no downsampling to laptops
    dashboard: bool = True  # beside teleop


@dataclass(frozen=True, slots=True)
class Outage:
    """The link is down for some time, or the laptop changes its address."""

    name: str
    seconds: float
    times: int
    moves: bool = False  # to another address


def narrow(bits: float, *, downsampled: bool, dashboard: bool) -> Condition:
    """Return a link with limited bandwidth in both directions."""
    size = f"{bits / 1e6:g} Mbit/s" if bits >= 1e6 else f"{bits / 1e3:g} kbit/s"
    clients = "" if dashboard else ", teleop alone"
    name = f"{size}{clients}{'' if downsampled else ', not thinned'}"
    return Condition(name, [Wire(rate=bits, delay=0.01)], downsampled, dashboard)


CONDITIONS = [
    Condition("good"),
    Condition("good, not thinned", downsampled=False),
    *(Condition(f"{round(100 * p)} % lost", [Wire(drop=p)]) for p in (0.01, 0.1, 0.3)),
    Condition("30 % lost on the way to the robot", [Wire(direction="to_pc", drop=0.3)]),
    Condition("30 % lost on the way to the laptop", [Wire(direction="to_board", drop=0.3)]),
    Condition("100 to 120 ms each way", [Wire(delay=0.1, jitter=0.02)]),
    Condition("200 to 250 ms each way", [Wire(delay=0.2, jitter=0.05)]),
    *(narrow(1e6, downsampled=downsampled, dashboard=True) for downsampled in (True, False)),
    *(narrow(256e3, downsampled=downsampled, dashboard=False) for downsampled in (True, False)),
    narrow(256e3, downsampled=True, dashboard=True),
    narrow(256e3, downsampled=False, dashboard=True),
]

OUTAGES = [
    Outage("down for 0.2 s", 0.2, 3),
    Outage("down for 1 s", 1.0, 3),
    Outage("down for 5 s", 5.0, 2),
    Outage("down for 30 s", 30.0, 1),
    Outage("another address, without a gap", 0.0, 2, moves=True),
    Outage("another address after 1 s", 1.0, 2, moves=True),
]
