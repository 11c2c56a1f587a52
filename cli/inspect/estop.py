"""``t2 estop``: emergency stop of one robot, a site or all, latched until an operator's reset.

The order is repeated until safety reports the latch: a router that drops it, by its access rules or
on a bad link, reports nothing. Each addressed robot must confirm. Robots that the router does not
know at this moment cannot be listed.
"""

import argparse
import sys
import time
from collections.abc import Sequence

from cli.inspect import output
from cli.inspect.addressing import chunks
from cli.inspect.session import add_options, decoded, open_session, repeated
from common import codec, keys
from common.bus.probe import Probe
from common.errors import LinkError, RobotError
from common.messages import SafetyState

TIMEOUT_S = 3.0
REPEAT_S = 0.1
SWITCH = "USE THE VEHICLE'S OWN SWITCH"
MOVES = ("bridge", "safety")  # a robot without these services cannot move


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "--keepalive", metavar="NAME",
        help="do not stop now: keep the emergency stop NAME of safety.estop_keepalive alive",
    )  # fmt: skip
    add_options(parser)


def run(options: argparse.Namespace, robot: str | None = None) -> int:
    """Stop the robot of the options, or another one; retry while no router is reachable."""
    if getattr(options, "keepalive", None):
        return keep_alive(options)
    end_s = time.monotonic() + TIMEOUT_S
    while True:
        try:
            with open_session(options) as session:
                return stop(session.probe, robot or session.robot, repeated(options))
        except LinkError as error:
            if time.monotonic() > end_s:
                raise LinkError(f"NOT SENT, {SWITCH}. {error}") from None


def keep_alive(options: argparse.Namespace) -> int:
    """Keep the emergency stop of one robot alive."""
    from cli.inspect import keepalive  # it uses this module

    with open_session(options) as session:
        if "*" in session.robot:
            raise RobotError("--keepalive works on one robot at a time; name it")
        return keepalive.hold(session, options.keepalive)


def stop(probe: Probe, robot: str, settings: str = "") -> int:
    """Stop one robot, or several by a key expression; return 1 if one does not confirm in time.

    ``settings`` are the options that advised commands repeat.
    """
    _order(probe, robot)  # before anything else
    probe.listen(keys.SAFETY.on(robot))
    expected = expected_robots(probe, robot)
    confirmed: set[str] = set()
    end_s = time.monotonic() + TIMEOUT_S
    while not confirmed >= expected and time.monotonic() < end_s:
        # By name, too: a driver's certificate may allow its own robots only, not an expression.
        for each in (robot, *sorted(expected - confirmed - {robot})):
            _order(probe, each)
        for sample in probe.samples(REPEAT_S):
            if any("estop" in state.latched for state in decoded([sample], SafetyState)):
                confirmed.add(chunks(sample.key)[0])
    missing = sorted(expected - confirmed)
    if missing == [robot]:
        if seen := other_robots(probe, robot):
            output.warn(f"t2 estop: no such robot {robot} at this router (seen: {', '.join(seen)})")
            return 1
        if is_barred(probe, robot):
            output.warn(
                f"t2 estop: not allowed: this certificate has no right to stop robot {robot} "
                "(as it seems: the router drops its commands)"
            )
    report(confirmed, missing, settings)
    return 0 if confirmed and not missing else 1


def expected_robots(probe: Probe, robot: str) -> set[str]:
    """Return the robots that must confirm: the named one, or all present ones."""
    if "*" not in robot:
        return {robot}
    tokens = map(chunks, probe.alive(keys.live_key(robot, "*", "*")))
    return {name for name, path in tokens if path.split("/")[1] in MOVES}


def report(confirmed: set[str], missing: Sequence[str], settings: str) -> None:
    """Print each stopped robot, and a warning for each that does not confirm."""
    for each in sorted(confirmed):
        release = f"t2 call safety/reset --robot {each}{settings}"
        print(f"Robot {each} is stopped. `{release}` releases it.")
    sys.stdout.flush()
    for each in missing:
        output.warn(
            f"t2 estop: sent, but safety of robot {each} does not confirm. "
            f"{SWITCH}, then `t2 doctor --robot {each}{settings}`."
        )
    robots = len(confirmed) + len(missing)
    if missing and robots > 1:
        count = f"{len(missing)} of {robots} robots"
        output.warn(f"t2 estop: {count} DO NOT CONFIRM: {', '.join(missing)}")
    if not robots:
        output.warn(
            f"t2 estop: sent, but no robot found. If one moves, {SWITCH}. `t2 robots` lists ids"
        )


def other_robots(probe: Probe, robot: str) -> list[str]:
    """Return the robots at the router if the named one is not among them; otherwise nothing."""
    present = {chunks(token)[0] for token in probe.alive(keys.live_key("*", "*", "*"))}
    return [] if robot in present else sorted(present)


def is_barred(probe: Probe, robot: str) -> bool:
    """Return whether the router drops the commands of this certificate, as it seems."""
    serves = probe.alive(keys.live_key(robot, "safety", "*"))
    # Each role that may stop may also do one of these, except fleet.
    topics = (keys.DRIVE, keys.LIMIT, keys.ESTOP_KEEPALIVE)
    commands = (topic.on(robot, source="*") for topic in topics)
    return bool(serves) and not probe.has_reader(*commands)


def _order(probe: Probe, robot: str) -> None:
    probe.put(keys.estop_key(robot), b"", codec.ENCODING, keys.ESTOP_CLASS)
