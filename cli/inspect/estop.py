"""``t2 estop``: emergency stop of one robot, a site or all, latched until an operator's reset.

The order is repeated until safety reports the latch, for ``ESTOP_WAIT_S``: a router that drops it,
by its access rules or on a bad link, reports nothing. Without a router it is sent once one answers
within this time. Each addressed robot must confirm. Robots that the router does not know at this
moment cannot be listed.

``--keepalive NAME`` keeps an emergency stop alive from a terminal, as a pendant does: safety brakes
and latches when this program ends, hangs or loses the robot.
"""

import argparse
import select
import shlex
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import TextIO

from cli.inspect import output
from cli.inspect.client import SafetyClient
from cli.inspect.session import add_options, open_session, services, until_interrupt
from common.bus.inspector import Inspector
from common.cli_args import hint, reader_language, source_words
from common.root_cause import WITHOUT_BRIDGE
from common.text import printable
from t2 import keys
from t2.client import ESTOP_WAIT_S
from t2.errors import LinkError, T2Error
from t2.messages import Limit, LimitState, SafetyState
from t2.words import Language, render

RETRY_S = 0.2  # without a router
KEEPALIVE_S = 0.1
SWITCH = "USE THE VEHICLE'S OWN SWITCH"
SILENT_S = 2.5  # without a state of safety, which over a thin uplink may have 1 Hz
SILENT = f"NOT KNOWN  no state of safety for {SILENT_S:g} s: {SWITCH} if the robot moves"
BARRED = "A driver of this robot resets it (R in `t2 drive`): this program may not."
MOVES = ("bridge", "safety")  # a robot without these services cannot move


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.add_argument(
        "--keepalive", metavar="NAME",
        help="do not stop now: keep the emergency stop NAME of safety.limits alive",
    )  # fmt: skip
    add_options(parser)


def run(options: argparse.Namespace) -> int:
    """Stop the robot of the options; retry while no router is reachable."""
    if options.keepalive:
        return keep_alive(options)
    end_s, is_reported = time.monotonic() + ESTOP_WAIT_S, False
    try:
        while True:
            try:
                with open_session(options) as session:
                    client = SafetyClient(session.inspector, session.robot)
                    return stop(client, session.user, source_words(options), end_s)
            except LinkError as error:
                if time.monotonic() > end_s:
                    raise LinkError(f"NOT SENT, {SWITCH}. {error}") from None
                if not is_reported:
                    is_reported = True
                    output.warn(
                        f"t2 estop: NOT SENT YET, {SWITCH}. It is sent if the router answers "
                        f"within {ESTOP_WAIT_S:g} s. {error}"
                    )
                time.sleep(RETRY_S)
    except KeyboardInterrupt:
        output.warn(f"t2 estop: ended by Ctrl-C before the stop was confirmed: {SWITCH}.")
        raise


def stop(client: SafetyClient, user: str, settings: Sequence[str] = (), end_s: float = 0.0) -> int:
    """Stop one robot, or several by a key expression; return 1 if one does not confirm in time.

    The event names the ``user``. ``settings`` are the options that advised commands repeat. A robot
    that does not confirm soon is reported, and the order is repeated until ``end_s``.
    """
    inspector, robot = client.inspector, client.robot
    client.order_stop(robot)  # before anything else
    expected = {robot}
    if "*" in robot:
        with suppress(LinkError):  # without the list: until one robot at least has confirmed
            expected = {name for name, service in services(inspector, robot) if service in MOVES}
    for each in expected:
        if "*" not in each:
            client.report_stop(each, user)
    # By name, too: a driver's certificate may allow its own robots only, not an expression.
    confirmed = client.stop(expected)
    states = dict(client.states)
    if missing := expected - confirmed:
        report_missing(client, missing, settings)
        confirmed |= insist(client, missing, end_s)
        states |= client.states
    unreached = {each for each in confirmed if is_unreached(states[each])}
    for each in sorted(confirmed - unreached):
        reset = shlex.join(["t2", "call", "safety/reset", "--robot", each, *settings])
        may_reset = inspector.has_server(keys.RESET.on(each))
        print(f"Robot {each} is stopped. {f'`{reset}` resets it.' if may_reset else BARRED}")
    sys.stdout.flush()
    warn(
        dict.fromkeys(unreached, "has latched it, but receives nothing from the vehicle"), settings
    )
    if not confirmed and not expected:
        output.warn(
            f"t2 estop: sent, but no robot found. If one moves, {SWITCH}. "
            f"{hint('robots', settings)} lists ids"
        )
    return 0 if confirmed and expected <= confirmed and not unreached else 1


def report_missing(client: SafetyClient, missing: set[str], settings: Sequence[str]) -> None:
    """Warn of robots that do not confirm, with the reason if it is known."""
    if missing == {client.robot}:
        with suppress(LinkError):
            if is_elsewhere(client.inspector, client.robot):
                return
    warn(dict.fromkeys(missing, "does not confirm"), settings)


def insist(client: SafetyClient, missing: set[str], end_s: float) -> set[str]:
    """Repeat the order until ``end_s``; return the robots that confirm it."""
    left_s = end_s - time.monotonic()
    if left_s <= 0:
        return set()
    output.warn(f"t2 estop: the order is repeated for {left_s:.0f} s.")
    confirmed = client.stop(missing, left_s)
    if names := ", ".join(sorted(missing - confirmed)):
        output.warn(
            f"t2 estop: robot {names} has not confirmed it within {ESTOP_WAIT_S:g} s: "
            f"repeated no longer. {SWITCH}."
        )
    return confirmed


def is_elsewhere(inspector: Inspector, robot: str) -> bool:
    """Return whether the robot is not at this router; warn of it, or of a missing right."""
    running = services(inspector, "*")
    present = sorted({name for name, service in running if service in keys.ON_BOARD})
    if present and robot not in present:
        seen = ", ".join(present)
        output.warn(
            f"t2 estop: robot {robot} is not at this router (seen: {seen}). If it moves, {SWITCH}."
        )
        return True
    if is_barred(inspector, robot):
        output.warn(
            f"t2 estop: not allowed: this certificate has no right to stop robot {robot} "
            "(as it seems: the router drops its commands)"
        )
    return False


def warn(trouble: Mapping[str, str], settings: Sequence[str]) -> None:
    """Warn of each robot that may not have stopped."""
    for each, what in sorted(trouble.items()):
        doctor = shlex.join(["t2", "doctor", "--robot", each, *settings])
        output.warn(f"t2 estop: sent; safety of robot {each} {what}. {SWITCH}, then `{doctor}`.")


def is_unreached(state: SafetyState) -> bool:
    """Return whether safety receives nothing from the board: the stop may not arrive there."""
    return any(cause.name in WITHOUT_BRIDGE for cause in state.causes)


def is_barred(inspector: Inspector, robot: str) -> bool:
    """Return whether the router drops the commands of this certificate, as it seems."""
    serves = services(inspector, robot, "safety")
    # Each role that may stop may also do one of these, except fleet.
    topics = (keys.DRIVE, keys.LIMIT)
    commands = (topic.on(robot, source="*") for topic in topics)
    return bool(serves) and not inspector.has_reader(*commands)


def keep_alive(options: argparse.Namespace) -> int:
    """Keep an emergency stop alive until Ctrl-C; return 1 when safety does not expect its name."""
    language = reader_language()
    with open_session(options) as session:
        if "*" in session.robot:
            raise T2Error("--keepalive works on one robot at a time; name it")
        name, robot = options.keepalive, session.robot
        client = SafetyClient(session.inspector, robot, name, language)
        ours = kept(client.fresh_state(), name)
        print(f"Keeping the emergency stop of robot {robot} alive as {name}.")
        print("Enter: EMERGENCY STOP. Ctrl-C ends this program: the robot then brakes and latches.")
        with until_interrupt():
            follow(client, name, session.user)
    print(f"Ended: within {ours.lease:g} s robot {robot} brakes and latches.", end=" ")
    print("To go on, start this again, then reset.")
    return 0


def kept(state: SafetyState, name: str) -> LimitState:
    """Return safety's state of this name; raise ``T2Error`` if it does not expect it."""
    known = {one.source: one for one in state.limit_sources if one.silence == "latch"}
    if name not in known:
        names = f"it expects {', '.join(known)}" if known else "it expects no keepalive"
        raise T2Error(f"safety does not expect {name!r}: {names}; see safety.limits")
    return known[name]


def follow(client: SafetyClient, name: str, user: str) -> None:
    """Publish at 10 Hz, print each change of state, and stop the robot on Enter."""
    shown = ""
    watched: list[TextIO] = [sys.stdin] if sys.stdin else []  # closed in some supervisors
    while True:
        client.put(keys.LIMIT, Limit(echo=0))
        state = None if client.is_silent(SILENT_S) else client.state
        if (line := described(state, name, client.language) if state else SILENT) != shown:
            print(line, flush=True)
            shown = line
        if select.select(watched, [], [], 0)[0]:
            if sys.stdin.readline():
                stop(client, user)
            else:
                watched = []  # the end of a file is no keystroke
        client.until(lambda: False, KEEPALIVE_S)


def described(state: SafetyState, name: str, language: Language = "en") -> str:
    """Return the state as a line."""
    text = render(state.phrases, language, state.text)
    alive = any(one.source == name and not one.silent for one in state.limit_sources)
    return f"{'alive' if alive else 'NOT ALIVE'}  {state.verdict.upper()}  {printable(text)}"
