"""What an operator's hands and terminal give to the core."""

from common.freshness import NS_PER_S
from services.teleop.core.controls import Deflection, Stick
from services.teleop.core.round_trip import RoundTrip

PERIOD_NS = NS_PER_S // 20


def answer(terminal: RoundTrip, now_ns: int, took_s: float = 0.001) -> None:
    """Simulate a terminal that answers now."""
    terminal.sent((0, 1), now_ns - round(took_s * NS_PER_S))
    terminal.answered((0, 1), now_ns)


def stick(linear: float = 1.0, *, deadman: bool = True, events: int = 0) -> Stick:
    """Return the state of a gamepad."""
    return Stick(Deflection(linear, 0), deadman, events)
