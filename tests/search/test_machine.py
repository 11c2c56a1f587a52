"""Events in any order: no frame that the board receives breaks an invariant.

The search is the same each time. A longer one, of more examples for each of the eight seeds, half a
second an example:

    T2_EXAMPLES=400 .venv/bin/pytest --timeout 0 tests/search/test_machine.py
"""

import os
from collections.abc import Callable
from typing import Any, Literal

import pytest
from hypothesis import HealthCheck, Phase, seed, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    rule,
    run_state_machine_as_test,
)
from msgspec.structs import replace

from sim import requests as q
from t2 import keys
from t2 import messages as m
from t2.messages import Command
from tests.search.scripted_stack import ALL_SONARS, FAULT_MM, NO_ECHO_MM, ScriptedStack
from verification.search.bus import CLEAR, ECHO_MS, HOLD_MS, Disturbance
from verification.search.condition_books import IGNORED, NEEDED, PENDANT
from verification.search.ros import PATTERNS

PATIENCE = 3  # rules
SEEDS, FEW_EXAMPLES = 8, 5  # for each seed
EXAMPLES = int(os.environ.get("T2_EXAMPLES", FEW_EXAMPLES))

# --- values: few, dense around thresholds ---------------------------------------------------------

ROUTES = st.sampled_from(["drive", "limit", "limit/pendant", "motion", "state", "streams"])
DISTURBANCES = st.sampled_from(
    [CLEAR, Disturbance(late_ms=30), Disturbance(late_ms=120), Disturbance(lose=2),
     Disturbance(lose=3), Disturbance(double=2), Disturbance(hold=3),
     Disturbance(late_ms=20, lose=5, double=3, hold=4), Disturbance(lose=1)]
)  # fmt: skip
WIRES = st.builds(
    q.Wire,
    direction=st.sampled_from(["to_board", "to_pc"]),
    drop=st.sampled_from([0.0, 0.0, 0.3]),
    duplicate=st.sampled_from([0.0, 0.5]),
    delay=st.sampled_from([0.0, 0.02]),
)
SPEEDS = st.sampled_from([0.0, 0.3, 1.0, -0.5, 5.0])
FAST = st.sampled_from([1.0, 0.6, -1.0])
TURNS = st.sampled_from([0.0, 0.0, 0.4, -1.0, 9.0])
CAPS = st.sampled_from([None, 0.0, 0.1, 0.3, 0.6, 5.0])
LIMITERS = st.sampled_from([NEEDED, IGNORED])
STICKS = "teleop", "nav"
SOURCES = st.sampled_from(STICKS)
DIRECTIONS: st.SearchStrategy[m.Direction] = st.sampled_from(["backward", "forward"])
KINDS = st.sampled_from(["estop", "bumper", "driver", "runaway", "router"])
HASTY = st.sampled_from([5, 90, 320, 700, 1000])
SHORT = st.sampled_from([5, 20, 60, 150, 210, 320])
LONG = st.sampled_from([400, 700, 1200])
RANGES_MM = st.sampled_from([NO_ECHO_MM, FAULT_MM, 0, 120, 190, 210, 260, 400, 800, 1500])
SONARS = st.sampled_from([ALL_SONARS, *(range(number, number + 1) for number in ALL_SONARS)])
SIDES: tuple[Literal["left", "right"], ...] = "left", "right"
BITS = st.sampled_from([0, 1, 1 << 31])
GARBAGE = st.binary(max_size=40).map(b"GS".__add__)  # begins as a frame does
RUNAWAY = st.sampled_from([1.5, -1.5, 0.0, None])
PROCESSES = st.sampled_from(["safety", "bridge"])
BOOT_MS = st.sampled_from([300, 600, 1000])
GUARDED_MS = st.sampled_from([50, 120, 180])  # less than the guard's limit
NEAR_MM = st.sampled_from([FAULT_MM, 190, 210, 260, 400, 800])
HOSTILE: st.SearchStrategy[tuple[m.SourceMessage, int]] = st.sampled_from(
    [  # a message with what its echo differs by, and what its number differs by
        (m.Drive(linear=0.5, angular=0.0, echo=-7), 1),
        (m.Drive(linear=0.5, angular=0.0, echo=-12), 1),
        (m.Drive(linear=0.5, angular=0.0, echo=0), 0),
        (m.Drive(linear=0.5, angular=0.0, echo=0, boot=5), 1),
        (m.Drive(linear=0.0, angular=0.0, echo=0, boot=6), 1),
        (m.Limit(echo=-7), 1),
        (m.Limit(echo=-12), 1),
        (m.Limit(linear=9.0, echo=0, boot=5), 1),
        (m.Limit(linear=0.0, echo=0, boot=6), 1),
    ]
)
FORGED = [m.Motion(command=Command.STOP), m.Motion(command=Command.RUN, linear=0.7)]


def verb(method: Callable[..., object], after_ms: int = 0) -> Callable[..., None]:
    """Return the function of a rule that calls a verb of the stack, and lets time pass."""

    def call(self: "StackMachine", **arguments: object) -> None:
        method(self.stack, **arguments)
        self.stack.run(after_ms)

    call.__name__ = method.__name__  # Hypothesis knows a rule by it
    return call


class StackMachine(RuleBasedStateMachine):
    """All faults and operators; the oracle checks every frame at the board."""

    def __init__(self) -> None:
        super().__init__()
        self.stack = ScriptedStack()
        self.oracle = self.stack.oracle
        self.cured = self.idle = 0

    @initialize(under_way=st.sampled_from([True, True, True, False]))
    def begin(self, under_way: bool) -> None:
        """Come up, and most often drive at once."""
        self.stack.run(700)
        if under_way:
            self.stack.drive(1.0, 600)

    # --- sensors, board, processes, bus and cable -------------------------------------------

    press = rule(pressed=st.booleans(), ms=SHORT)(verb(ScriptedStack.press))
    sonars = rule(mm=RANGES_MM, numbers=SONARS)(verb(ScriptedStack.sonars, 60))
    driver = rule(side=st.sampled_from(SIDES), bits=BITS, ms=SHORT)(verb(ScriptedStack.driver))
    measure = rule(linear=RUNAWAY, ms=SHORT)(verb(ScriptedStack.measure))
    velocities = rule(on=st.booleans(), ms=SHORT | LONG)(verb(ScriptedStack.velocities))
    switches = rule(on=st.booleans())(verb(ScriptedStack.switches, 60))
    freeze = rule(ms=SHORT | LONG)(verb(ScriptedStack.freeze, 60))
    power_cycle = rule(ms=BOOT_MS)(verb(ScriptedStack.power_cycle))
    send = rule(datagram=GARBAGE)(verb(ScriptedStack.send, 5))
    limit = rule(linear=CAPS, angular=CAPS, source=LIMITERS, ms=SHORT | LONG)(
        verb(ScriptedStack.limit)
    )
    cable = rule(wire=WIRES, ms=SHORT)(verb(ScriptedStack.cable))
    kill = rule(name=PROCESSES, pause_ms=SHORT | LONG)(verb(ScriptedStack.kill, 60))
    stall = rule(name=st.just("bridge"), duration_ms=GUARDED_MS)(verb(ScriptedStack.stall, 60))
    outage = rule(ms=st.just(0) | SHORT | LONG)(verb(ScriptedStack.outage))
    disturb = rule(route=ROUTES, disturbance=DISTURBANCES, ms=SHORT)(verb(ScriptedStack.disturb))

    @rule(source=LIMITERS, ms=SHORT | LONG)
    def silence_limit(self, source: str, ms: int) -> None:
        before = self.stack.sources[source].message
        self.stack.silence(source, ms)
        self.stack.sources[source].message = before

    @rule(ms=st.sampled_from([400, 900, 1000, 1005, 1100, 2000]))
    def silence_pendant(self, ms: int) -> None:
        self.silence_limit(PENDANT, ms)

    @rule(ms=SHORT | LONG, estop_ms=st.none() | SHORT)
    def stall_safety(self, ms: int, estop_ms: int | None) -> None:
        """Stall safety; perhaps press the emergency stop meanwhile."""
        self.stack.stall("safety", ms)
        self.stack.run(60)
        if estop_ms is not None:
            self.stack.run(estop_ms)
            self.stack.stop()

    @rule(route=ROUTES, ms=SHORT)
    def cut(self, route: str, ms: int) -> None:
        """Lose everything on one route for a while."""
        before = self.stack.net.disturbances.get(route, CLEAR)
        self.stack.disturb(route, Disturbance(lose=1), ms)
        self.stack.net.disturbances[route] = before

    @rule(settled=st.booleans())
    def end_disturbances(self, settled: bool) -> None:
        """End all disturbances, before or after delayed messages arrive."""
        self.stack.run(ECHO_MS + HOLD_MS + 120 if settled else 0)
        self.stack.net.disturbances.clear()
        self.stack.cable(q.Wire(), 0)

    @rule(hostile=HOSTILE, needed=st.booleans(), name=st.sampled_from(["", "", "nobody"]))
    def hostile_message(
        self, hostile: tuple[m.SourceMessage, int], needed: bool, name: str
    ) -> None:
        """Send a request or a limit that safety must refuse."""
        message, step = hostile
        stack = self.stack
        limits = isinstance(message, m.Limit)
        names = (NEEDED, IGNORED) if limits else STICKS
        sender = stack.sources[names[0] if needed else names[1]]
        sender.put(replace(message, echo=sender.echo + message.echo), name=name, step=step)
        stack.run(5)

    @rule(late=st.integers(0, 40), boot=st.sampled_from([0, 0, 7]))
    def hostile_keepalive(self, late: int, boot: int) -> None:
        """Send a sign of life with an old echo, or of another program."""
        pendant = self.stack.sources[PENDANT]
        pendant.put(m.Limit(echo=pendant.echo - late, boot=boot))
        self.stack.run(5)

    @rule(seq=st.integers(1, 2**62), boot=st.sampled_from([None, 1]))
    def forged_motions(self, seq: int, boot: int | None) -> None:
        """Publish motions as a client of the router, with safety's boot or another."""
        boot = boot or self.stack.processes["safety"].boot
        for step, motion in enumerate(FORGED):
            self.stack.forge(keys.MOTION, replace(motion, seq=seq + step, boot=boot))
        self.stack.run(5)

    @rule(pressed=st.booleans(), linear=st.sampled_from([0.0, 3.0]), seq=st.integers(1, 2**62))
    def forged_samples(self, pressed: bool, linear: float, seq: int) -> None:
        """Publish measurements as a client of the router, with the bridge's boot."""
        stamp: dict[str, Any] = {"seq": seq, "boot": self.stack.processes["bridge"].boot}
        self.stack.forge(keys.BUMPER, m.Bumper(pressed=pressed, **stamp))
        self.stack.forge(keys.VELOCITY, m.Velocity(linear=linear, angular=0.0, **stamp))
        self.stack.run(60)

    # --- operators --------------------------------------------------------------------------

    drive = rule(linear=SPEEDS, angular=TURNS, source=SOURCES, ms=SHORT | LONG)(
        verb(ScriptedStack.drive)
    )
    request = rule(linear=st.none() | SPEEDS, angular=TURNS, source=SOURCES, ms=SHORT | LONG)(
        verb(ScriptedStack.request)
    )
    ros = rule(
        pattern=st.none() | st.sampled_from([*PATTERNS]), linear=FAST, ms=LONG,
        unheard=st.sampled_from([0, 45]),
    )(verb(ScriptedStack.ros, 700))  # fmt: skip
    stop = rule(ms=SHORT)(verb(ScriptedStack.stop))
    creep = rule(direction=DIRECTIONS, times=st.integers(1, 8))(verb(ScriptedStack.creep))

    # Hypothesis draws the first rule most often: that of the fewest arguments and the first name.
    @rule(linear=FAST)
    def ahead(self, linear: float) -> None:
        """Ask for motion without a neutral request, as someone who noticed nothing does."""
        self.stack.request(linear, 210)

    @rule(lets_go=st.booleans())
    def reset(self, lets_go: bool) -> None:
        """Ask for a reset, with the controls released or not."""
        if lets_go:
            for source in STICKS:
                self.stack.request(None, source=source)
            self.stack.run(500)  # a ROS node goes on
        self.stack.reset()

    @rule(kind=KINDS, ms=LONG, dies=st.sampled_from(["nobody", "safety", "bridge"]))
    def insist(self, kind: str, ms: int, dies: str) -> None:
        """Trip something, cure it at once, and drive on without a reset; safety may die of it."""
        self.stack.trip(kind)
        if dies != "nobody":
            self.stack.kill(dies, 20)
        self.stack.run(ms)
        self.stack.drive(1.0, ms)

    @rule(kind=KINDS, gone_ms=HASTY, requested=st.booleans())
    def hasty_reset(self, kind: str, gone_ms: int, requested: bool) -> None:
        """Trip something, cure it, and reset too early or with the stick still pushed."""
        self.stack.trip(kind)
        self.stack.request(0.5 if requested else 0.0, gone_ms)
        self.stack.reset()
        self.stack.drive(1.0, 400)

    @rule(first=KINDS, then=KINDS, ms=st.sampled_from([20, 210, 700, 1200]))
    def late_reset(self, first: str, then: str, ms: int) -> None:
        """Trip something, trip more, and let the reset of the first arrive after that."""
        self.stack.trip(first)
        self.stack.request(None, 400)
        seen = self.stack.seen
        self.stack.trip(then)
        self.stack.run(ms)
        self.stack.reset(seen)
        self.stack.drive(1.0, 400)

    @rule(direction=DIRECTIONS, ms=SHORT | LONG, times=st.integers(1, 8))
    def late_release(self, direction: m.Direction, ms: int, times: int) -> None:
        """Deliver requests of a release late, all at once, and perhaps after its end."""
        echo = self.stack.sources["teleop"].echo
        self.stack.creep(direction, times // 2)
        self.stack.run(ms)
        self.stack.put_release("none", echo)
        for _ in range(times):
            self.stack.put_release(direction, echo)
            self.stack.run(20)

    @rule(direction=DIRECTIONS, source=st.sampled_from(["teleop", "nav"]), ms=SHORT | LONG)
    def held_into_a_contact(self, direction: m.Direction, source: str, ms: int) -> None:
        """Hold the release before the contact, or as a program, and go on holding it."""
        self.stack.hold(direction, ms, source=source)
        self.stack.press(True, 1200)
        self.stack.request(None, source=source)
        self.stack.press(False, 320)

    @rule(direction=DIRECTIONS, other=DIRECTIONS, ms=st.sampled_from([20, 60, 150, 700]))
    def pressed_again(self, direction: m.Direction, other: m.Direction, ms: int) -> None:
        """Drive into something, get off it, and touch something again on the way."""
        self.stack.drive(1.0, 400)
        self.stack.press(True)
        self.stack.request(None, 1200)
        self.stack.creep(direction, 6)
        self.stack.press(False, ms)
        self.stack.press(True, ms)
        self.stack.creep(direction, 6)
        self.stack.creep(other, 12)
        self.stack.press(False, 320)

    @rule(kind=KINDS, resets=st.booleans(), dies=st.booleans())
    def stuck(self, kind: str, resets: bool, dies: bool) -> None:
        """Drive into something, with more amiss, and creep off with or without a reset."""
        self.stack.drive(1.0, 400)
        self.stack.press(True)
        self.stack.trip("estop" if kind == "bumper" else kind)
        if dies:
            self.stack.kill("safety", 20)
        self.stack.request(None, 1200)
        self.stack.creep(times=2)
        if resets:
            self.stack.reset()
        self.stack.creep(times=6)
        self.stack.press(False, 320)

    @rule(linear=FAST, route=ROUTES, disturbance=DISTURBANCES, hits=st.booleans())
    def storm(self, linear: float, route: str, disturbance: Disturbance, hits: bool) -> None:
        """Drive under a disturbance, perhaps hit something, and end it."""
        self.stack.drive(linear, 400)
        self.stack.disturb(route, disturbance, 210)
        self.stack.press(hits, 60)
        self.end_disturbances(settled=False)
        self.stack.run(210)

    @rule(linear=FAST, gap_ms=st.sampled_from([450, 600, 1200]))
    def burst(self, linear: float, gap_ms: int) -> None:
        """Silence a source, then deliver its old requests all at once."""
        stick = self.stack.sources["teleop"]
        echo = stick.echo
        self.stack.request(None, gap_ms)
        for speed in [0.0] * 5 + [linear] * 10:
            stick.put(m.Drive(linear=speed, angular=0.0, echo=echo))
            self.stack.run(10)

    @rule(source=LIMITERS, linear=FAST, cap=CAPS, ms=LONG)
    def limited(self, source: str, linear: float, cap: float | None, ms: int) -> None:
        """Drive fast, then limit the speed, and end the limit while the stick is pushed."""
        self.stack.drive(linear, 700, angular=0.4)
        self.stack.limit(cap, ms, source=source)
        self.stack.limit(None, 400, source=source)

    @rule(source=SOURCES, linear=FAST, mm=NEAR_MM, ms=LONG)
    def approach(self, source: str, linear: float, mm: int, ms: int) -> None:
        """Drive on while something is near all around, as far as safety lets it."""
        self.stack.sonars(mm)
        self.stack.drive(linear, ms, source=source)

    # --- the end ----------------------------------------------------------------------------

    @invariant()
    def no_frame_breaks_an_invariant(self) -> None:
        """Check all frames since the last check."""
        violations = list(dict.fromkeys(self.oracle.violations))[:5]
        assert not violations

    @invariant()
    def nobody_stands_for_long(self) -> None:
        """Cure everything after some rules without motion; what was wrong was wrong for long."""
        moves = abs(self.stack.vehicle.simulation.twist.linear) > 0.05
        self.idle = 0 if moves else self.idle + 1
        if self.idle > PATIENCE:
            self.cure()
            self.no_frame_breaks_an_invariant()

    def cure(self) -> None:
        """Cure everything, reset, and drive: there must be something at stake."""
        stack = self.stack
        stack.press(False)
        stack.measure(None)
        stack.velocities(True)
        stack.sonars(None)
        for side in SIDES:
            stack.driver(0, side=side)
        self.end_disturbances(settled=False)
        stack.limit(None, source=NEEDED)
        stack.silence(IGNORED)
        stack.run(1000)
        stack.switches(on=True)
        stack.run(60)
        self.reset(lets_go=True)
        stack.drive(-1.0 if self.cured % 2 else 1.0, 700)
        self.cured += 1

    def teardown(self) -> None:
        """When all sources fall silent, the vehicle is stopped and stays stopped."""
        for source in STICKS:
            self.stack.request(None, source=source)
        self.stack.ros(None)
        self.stack.kill("safety", 10_000)
        self.stack.run(1200)
        self.no_frame_breaks_an_invariant()


@pytest.mark.parametrize("number", range(SEEDS))
def test_no_order_of_events_breaks_an_invariant(number: int) -> None:
    # Hypothesis draws its first ten examples afresh and varies them from there on: few examples
    # of many seeds are more different than many of one.
    machine = seed(number)(type(f"StackMachine{number}", (StackMachine,), {}))
    run_state_machine_as_test(
        machine,
        settings=settings(
            max_examples=EXAMPLES,
            stateful_step_count=20,
            # Making an example smaller takes minutes: more than a test may take.
            phases=[Phase.generate] if EXAMPLES <= FEW_EXAMPLES else list(Phase),
            deadline=None,
            database=None,
            suppress_health_check=list(HealthCheck),
        ),
    )
