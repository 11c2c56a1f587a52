"""``t2 estop``: stop the robot now; it stays so until an operator's reset.

The order is sent again and again until safety says that it has latched: a router that drops it, by
its access rules or because the way is bad, does not tell.
"""

import argparse
import sys
import time

from cli.inspect.addressing import chunks
from cli.inspect.shell import add_options, seated
from common import codec, keys
from common.bus.probe import Probe
from common.errors import LinkError, MessageError
from common.messages import SafetyState
from common.sample import Sample

PATIENCE_S = 3.0
AGAIN_S = 0.1
SWITCH = "USE THE VEHICLE'S OWN SWITCH"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """Stop it; 1 when nobody confirms."""
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
    """Stop one robot, or all for ``*``; return 1 when one does not confirm in time."""
    _order(probe, robot)  # before anything else
    probe.listen(keys.SAFETY.on(robot))
    expected = {chunks(token)[0] for token in probe.alive(keys.live_key(robot, "safety", "*"))}
    expected |= {robot} - {"*"}
    confirmed: set[str] = set()
    end_s = time.monotonic() + PATIENCE_S
    while not confirmed >= expected and time.monotonic() < end_s:
        _order(probe, robot)
        for heard in probe.samples(AGAIN_S):
            confirmed |= _latched(heard)
    for each in sorted(confirmed):
        print(f"Robot {each} is stopped. `t2 call safety/reset` lets it go on.")
    for each in sorted(expected - confirmed):
        print(
            f"t2 estop: sent, but safety of robot {each} does not confirm. "
            f"{SWITCH}, then `t2 doctor`.",
            file=sys.stderr,
        )
    if not expected:
        print("t2 estop: sent, but no robot is there", file=sys.stderr)
    return 0 if confirmed and confirmed >= expected else 1


def _order(probe: Probe, robot: str) -> None:
    probe.put(keys.estop_key(robot), b"", codec.ENCODING, keys.ESTOP_CLASS)


def _latched(heard: Sample) -> set[str]:
    try:
        state = codec.decode(heard.payload, SafetyState)
    except MessageError:
        return set()
    return {chunks(heard.key)[0]} if "estop" in state.latched else set()
