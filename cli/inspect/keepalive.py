"""``t2 estop --keepalive NAME``: keep an emergency stop alive from a terminal, as a pendant does.

Safety brakes and latches when this program ends, hangs or loses the robot.
"""

import select
import sys

from cli.inspect import estop, output
from cli.inspect.session import BusSession, decoded, until_interrupt
from common import cli_codec, codec, keys
from common.bus.probe import Probe
from common.messages import KeepaliveState, SafetyState

PERIOD_S = 0.1
FIRST_S = 2.0  # wait for safety's first state, which has 20 Hz


def hold(session: BusSession, name: str) -> int:
    """Keep the emergency stop alive until Ctrl-C; return 1 when safety does not expect the name."""
    probe, robot = session.probe, session.robot
    probe.listen(keys.SAFETY.on(robot))
    state = next(decoded(probe.samples(FIRST_S), SafetyState), None)
    if (problem := refusal(state, name)) or state is None:
        output.warn(f"t2 estop: {problem}")
        return 1
    print(f"Keeping the emergency stop of robot {robot} alive as {name}.")
    print("Enter: EMERGENCY STOP. Ctrl-C ends this program: the robot then brakes and latches.")
    with until_interrupt():
        follow(probe, robot, name, state)
    print(f"Ended: within {timeout_s(state, name):g} s robot {robot} brakes and latches.", end=" ")
    print("To go on, start this again, then reset.")
    return 0


def follow(probe: Probe, robot: str, name: str, state: SafetyState) -> None:
    """Publish at 10 Hz, print each change of state, and stop the robot on Enter."""
    shown, watched = "", [sys.stdin] if sys.stdin else []  # closed in some supervisors
    while True:
        put(probe, robot, name, state.heartbeat)
        if (line := described(state, name)) != shown:
            print(line, flush=True)
            shown = line
        if select.select(watched, [], [], 0)[0]:
            if sys.stdin.readline():
                estop.stop(probe, robot)
            else:
                watched = []  # the end of a file is no key
        for newer in decoded(probe.samples(PERIOD_S), SafetyState):
            state = newer


def put(probe: Probe, robot: str, name: str, heartbeat: int) -> None:
    """Publish one sign of life."""
    topic = keys.ESTOP_KEEPALIVE
    key = topic.on(robot, source=name)
    payload = cli_codec.encode(key, f'{{"echo": {heartbeat}}}')
    probe.put(key, payload, codec.encoding(topic.message), topic.service)


def refusal(state: SafetyState | None, name: str) -> str:
    """Return why the name cannot be kept alive; empty if it can."""
    if state is None:
        return "safety publishes no state; check it with `t2 doctor`"
    known = [one.source for one in state.estop_keepalives]
    if name in known:
        return ""
    names = f"it expects {', '.join(known)}" if known else "it expects no keepalive"
    return f"safety does not expect {name!r}: {names}; see safety.estop_keepalive"


def described(state: SafetyState, name: str) -> str:
    """Return the state as a line."""
    ours = own(state, name)
    alive = "alive" if ours and ours.alive else "NOT ALIVE"
    return f"{alive}  {state.verdict.upper()}  {state.text}"


def timeout_s(state: SafetyState, name: str) -> float:
    """Return the time until safety brakes."""
    ours = own(state, name)
    return ours.timeout if ours else 0.0


def own(state: SafetyState, name: str) -> KeepaliveState | None:
    """Return the state of this name."""
    return next((one for one in state.estop_keepalives if one.source == name), None)
