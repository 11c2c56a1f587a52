"""What ``t2 replay`` plays onto a bus. Pure.

It never plays what moves or stops the vehicle: no drive request, no motion command and no emergency
stop.
"""

from collections.abc import Collection

from common import keys

DECIDING = ("bridge", "safety")  # services that act, and on whose messages others act


def is_played(path: str, alive: Collection[str]) -> bool:
    """Return whether to play a key below the robot, besides these running services."""
    moves = path == keys.ESTOP_PATH or any(part.startswith("@") for part in path.split("/"))
    return not moves and publisher(path) not in alive


def publisher(path: str) -> str:
    """Return the service that publishes a stream or an event; empty for other keys."""
    kind, _, rest = path.partition("/")
    return rest.partition("/")[0] if kind in ("tel", "evt") else ""


def refusal(robot: str, alive: Collection[str]) -> str:
    """Return why a replay is refused while these services run; empty if it is allowed."""
    running = " and ".join(name for name in DECIDING if name in alive)
    if not running:
        return ""
    return (
        f"robot {robot} has a running {running}: others would take replayed messages for the real "
        "ones. Stop it, or replay as another robot: --robot replay"
    )
