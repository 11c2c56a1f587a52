"""Artificial poses, states, views and traces of a lap."""

from typing import Any, TypeVar

import msgspec
from msgspec import Struct

from cli.demo.score import Trace
from common import motion
from common.freshness import NS_PER_S
from sim import trace as t
from t2.messages import Odometry
from tests import factories

M = TypeVar("M", bound=Struct)
RUN, STOP, BRAKE = motion.Command

TICK_NS = NS_PER_S // 20  # the simulator records the truth at 20 Hz


def as_client(message: Struct, kind: type[M]) -> M:
    """Return a message of the stack as the client library decodes it."""
    return msgspec.msgpack.decode(msgspec.msgpack.encode(message), type=kind)


def odometry(**fields: Any) -> Odometry:
    """Return a standing pose at the start, with the given differences."""
    standing = dict.fromkeys(("x", "y", "heading", "linear", "residual"), 0.0)
    return as_client(factories.odometry(**(standing | fields)), Odometry)


def truth(tick: int, **fields: Any) -> t.Truth:
    """Return the truth at a tick: standing at the start with 1 m clearance."""
    known: dict[str, Any] = dict.fromkeys(
        ("x", "y", "heading", "linear", "angular", "distance"), 0.0
    )
    known |= {
        "clearance": 1.0,
        "contact": False,
        "pressed": False,
        "command": command(0, STOP),
        "braking": False,
        "ultrasonic_brake": True,
        "bumper_brake": True,
        "silent": False,
    }
    return t.Truth(mono_ns=tick * TICK_NS, **(known | fields))


def command(at_ns: int, kind: motion.Command, linear: float = 0.0) -> t.Command:
    """Return a command that the board accepted."""
    return t.Command(mono_ns=at_ns, kind=kind, linear=linear, angular=0.0)


def hit_lap(stands: bool = True, brakes: bool = True) -> Trace:
    """Return 2 m at 0.8 m/s, a hit at tick 50, BRAKE 20 ms later, standstill after 4 cm."""
    hit_ns = 50 * TICK_NS
    driving = [truth(n, x=n * 0.04, distance=n * 0.04, linear=0.8) for n in range(51)]
    still = [truth(51 + n, x=2.04, distance=2.04, linear=0.0, contact=True) for n in range(40)]
    on = [truth(51 + n, x=2.0 + n * 0.04, distance=2.0 + n * 0.04, linear=0.8) for n in range(40)]
    commands = [
        command(0, RUN, 0.8),
        *([command(hit_ns + NS_PER_S // 50, BRAKE)] if brakes else []),
    ]
    bumper = [
        t.BumperSent(mono_ns=0, pressed=False),
        t.BumperSent(mono_ns=hit_ns, pressed=True),
    ]
    return Trace(driving + (still if stands else on), commands, bumper)
