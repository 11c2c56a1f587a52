"""``t2 estop``: stop the robot now, a site's or all; it stays so until an operator's reset.

The order is sent again and again until safety says that it has latched: a router that drops it, by
its access rules or because the way is bad, does not tell. Who has many robots stopped hears of each
whether it has. A robot that the router does not know of at this moment cannot be told of.
"""

import argparse
import sys
import time

from cli.inspect.addressing import chunks, is_many
from cli.inspect.shell import add_options, seated
from common import codec, keys
from common.bus.probe import Probe
from common.errors import LinkError, MessageError
from common.messages import SafetyState
from common.sample import Sample

PATIENCE_S = 3.0
AGAIN_S = 0.1
SWITCH = "USE THE VEHICLE'S OWN SWITCH"
MOVES = ("bridge", "safety")  # a robot without either moves nothing


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """Stop it; 1 when one does not confirm."""
    return insist(options)


def insist(options: argparse.Namespace, robot: str | None = None) -> int:
    """Stop it, or another robot; a router that is not there may be about to come back."""
    end_s = time.monotonic() + PATIENCE_S
    while True:
        try:
            with seated(options) as seat:
                return stop(seat.probe, robot or seat.robot)
        except LinkError as error:
            if time.monotonic() > end_s:
                raise LinkError(f"NOT SENT, {SWITCH}. {error}") from None


def stop(probe: Probe, robot: str) -> int:
    """Stop one robot, or many by an expression; return 1 when one does not confirm in time."""
    _order(probe, robot)  # before anything else
    probe.listen(keys.SAFETY.on(robot))
    expected = there(probe, robot)
    confirmed: set[str] = set()
    end_s = time.monotonic() + PATIENCE_S
    while not confirmed >= expected and time.monotonic() < end_s:
        # By name, too: a driver may stop its own robots and not all.
        for each in (robot, *sorted(expected - confirmed - {robot})):
            _order(probe, each)
        for heard in probe.samples(AGAIN_S):
            if chunks(heard.key)[0] not in confirmed and _latched(heard):
                confirmed.add(chunks(heard.key)[0])
    tell(confirmed, expected)
    return 0 if confirmed and confirmed >= expected else 1


def there(probe: Probe, robot: str) -> set[str]:
    """Return who has to confirm: the robot that is named, and of many those that are there."""
    if not is_many(robot):
        return {robot}
    tokens = map(chunks, probe.alive(keys.live_key(robot, "*", "*")))
    return {name for name, path in tokens if path.split("/")[1] in MOVES}


def tell(confirmed: set[str], expected: set[str]) -> None:
    """Name each robot that has stopped, and loudly each that has not said so."""
    for each in sorted(confirmed):
        print(f"Robot {each} is stopped. `t2 call safety/reset --robot {each}` lets it go on.")
    missing = sorted(expected - confirmed)
    for each in missing:
        print(
            f"t2 estop: sent, but safety of robot {each} does not confirm. "
            f"{SWITCH}, then `t2 doctor --robot {each}`.",
            file=sys.stderr,
        )
    if missing and len(expected) > 1:
        count = f"{len(missing)} of {len(expected)} robots"
        print(f"t2 estop: {count} DO NOT CONFIRM: {', '.join(missing)}", file=sys.stderr)
    if not confirmed | expected:
        print("t2 estop: sent, but no robot is there", file=sys.stderr)


def _order(probe: Probe, robot: str) -> None:
    probe.put(keys.estop_key(robot), b"", codec.ENCODING, keys.ESTOP_CLASS)


def _latched(heard: Sample) -> bool:
    try:
        state = codec.decode(heard.payload, SafetyState)
    except MessageError:
        return False
    return "estop" in state.latched
