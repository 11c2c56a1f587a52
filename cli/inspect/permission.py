"""On which keys a tool may speak: on none that moves the wheels or that a service's word is on.

A named option lets it through to a simulated vehicle. Whether it is one is not taken from the
option: the bridge says what board it has, and a simulated one is on the bridge's own host.
"""

import ipaddress

from cli.inspect.addressing import chunks
from common import codec, keys
from common.bus.probe import Probe
from common.errors import RobotError
from common.messages import Link

OWN = ("bridge", "safety", "odom")  # whose words the others act on
LOOK_S = 1.5  # the bridge tells of its link five times a second; all of it, there may be two


def check(key: str, simulator: bool, probe: Probe) -> None:
    """Raise ``RobotError`` for a key that is not a tool's to speak on."""
    why = reason(key)
    if not why:
        return
    if not simulator:
        raise RobotError(
            f"{chunks(key)[1]} {why}. `t2 drive` drives, `t2 estop` stops; "
            "--simulator lets it through to a simulated vehicle"
        )
    robot = chunks(key)[0]
    boards = heard_of(robot, probe)
    if not boards:
        raise RobotError(f"--simulator: no bridge of robot {robot} tells what board it has")
    for board in sorted(boards):
        if not is_loopback(board):
            raise RobotError(f"--simulator: the board of robot {robot} is at {board}: a real one")


def reason(key: str) -> str:
    """Say why a tool may not speak on a key; nothing when it may."""
    if any(part.startswith("@") for part in key.split("/")):
        return "moves the wheels"
    kind, _, rest = chunks(key)[1].partition("/")
    service = rest.partition("/")[0]
    if kind in ("tel", "evt") and service in OWN:
        return f"is {service}'s alone: others act on what it says"
    return ""


def heard_of(robot: str, probe: Probe) -> set[str]:
    """Return every board, ``address:port``, that a bridge of this robot has."""
    key = keys.LINK.on(robot)
    probe.listen(key)
    came = [heard for heard in probe.samples(LOOK_S) if heard.key == key]
    return {codec.decode(heard.payload, Link).board for heard in came}


def is_loopback(board: str) -> bool:
    """Tell whether an ``address:port`` is of the host itself."""
    try:
        return ipaddress.ip_address(board.rpartition(":")[0].strip("[]")).is_loopback
    except ValueError:
        return False
