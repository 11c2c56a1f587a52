"""Anything in any order: no frame that the board receives breaks an invariant.

In CI the search is the same each time. A longer one, another each time:

    T2_EXAMPLES=3000 .venv/bin/pytest tests/invariants --timeout 0
"""

import os

from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from msgspec.structs import replace

from common import keys
from common import messages as m
from common.wire.frame import Side
from sim.vehicle import Twist
from tests.invariants.judge import STEP_NS
from tests.invariants.net import CLEAR, ECHO_MS, HOLD_MS, MS, Letter, Weather
from tests.invariants.process import ROBOT
from tests.invariants.stack import Stack
from tests.invariants.strategies import (
    BUS,
    CABLE,
    FAST,
    FORGED,
    HOSTILE,
    LONG,
    NEAR_MM,
    ON_BUS,
    ON_CABLE,
    PROCESSES,
    RANGES_MM,
    SHORT,
    SOURCES,
    SPEEDS,
    TURNS,
)
from tests.invariants.vehicle import NO_ECHO_MM

EXAMPLES = int(os.environ.get("T2_EXAMPLES", "0"))


class Anything(RuleBasedStateMachine):
    """Rules are what may happen; the judge looks at every frame that the board receives."""

    def __init__(self) -> None:
        super().__init__()
        self.stack = Stack()
        self.judge = self.stack.judge

    @initialize(under_way=st.sampled_from([True, True, True, False]))
    def begin(self, under_way: bool) -> None:
        """Come up, and most often drive."""
        self.stack.run(700)
        if under_way:
            self.off_we_go("teleop", 1.0, 0.0, 600)

    # --- people -----------------------------------------------------------------------------

    @rule(source=SOURCES, linear=SPEEDS, angular=TURNS, ms=SHORT | LONG)
    def off_we_go(self, source: str, linear: float, angular: float, ms: int) -> None:
        """Ask for zero until inputs have settled, then for motion: the way it is meant."""
        self.stack.sticks[source].asks = (0.0, 0.0)
        self.stack.run(650)
        self.ask(source, linear, angular, ms)

    @rule(source=SOURCES, linear=FAST, angular=TURNS, ms=LONG)
    def recover(self, source: str, linear: float, angular: float, ms: int) -> None:
        """Cure everything, reset, and drive."""
        vehicle = self.stack.vehicle
        vehicle.pressed, vehicle.measured = False, None
        vehicle.ranges[:] = [NO_ECHO_MM] * 8
        for side in Side:
            vehicle.fault(side, 0)
        self.stack.net.weather.clear()
        self.brakes(on=True)
        self.wait(1000)
        self.reset(lets_go=True)
        self.off_we_go(source, linear, angular, ms)

    @rule(kind=st.sampled_from(["estop", "bumper", "driver", "runaway"]), linear=FAST, ms=LONG)
    def insist(self, kind: str, linear: float, ms: int) -> None:
        """Trip something, cure it at once, and try to drive on without a reset."""
        vehicle = self.stack.vehicle
        if kind == "estop":
            self.stack.estop()
        elif kind == "bumper":
            self.bumper(pressed=True, ms=60)
            vehicle.pressed = False
        elif kind == "driver":
            self.driver(Side.LEFT, 1 << 31, 60)
            vehicle.fault(Side.LEFT, 0)
        else:
            self.runaway(1.5, 700)
            vehicle.measured = None
        self.wait(ms)
        self.off_we_go("teleop", linear, 0.0, ms)

    @rule(source=SOURCES, linear=FAST, mm=NEAR_MM, ms=LONG)
    def approach(self, source: str, linear: float, mm: int, ms: int) -> None:
        """Drive on while something is near all around, as far as safety lets it."""
        self.stack.vehicle.ranges[:] = [mm] * 8
        self.off_we_go(source, linear, 0.0, ms)

    @rule(source=SOURCES, linear=SPEEDS, angular=TURNS, ms=SHORT)
    def ask(self, source: str, linear: float, angular: float, ms: int) -> None:
        """Ask for something, and go on asking."""
        self.stack.sticks[source].asks = (linear, angular)
        self.stack.run(ms)

    @rule(source=SOURCES)
    def let_go(self, source: str) -> None:
        """Fall silent, as a driver program that has died."""
        self.stack.sticks[source].asks = None

    @rule(ms=SHORT | LONG)
    def wait(self, ms: int) -> None:
        """Let time pass."""
        self.stack.run(ms)

    @rule()
    def estop(self) -> None:
        """Press the emergency stop."""
        self.stack.estop()

    @rule(lets_go=st.booleans())
    def reset(self, lets_go: bool) -> None:
        """Ask for a reset, with the controls released or not."""
        if lets_go:
            for stick in self.stack.sticks.values():
                stick.asks = None
            self.stack.run(500)
        self.stack.reset()

    @rule(times=st.integers(1, 8))
    def release(self, times: int) -> None:
        """Hold the release for a while."""
        for _ in range(times):
            self.stack.hold(True)
            self.stack.run(60)

    # --- what the board sees ----------------------------------------------------------------

    @rule(pressed=st.booleans(), ms=SHORT)
    def bumper(self, pressed: bool, ms: int) -> None:
        """Press the bumper, or free it."""
        self.stack.vehicle.pressed = pressed
        self.stack.run(ms)

    @rule(sonar=st.integers(0, 7), mm=RANGES_MM)
    def sonar(self, sonar: int, mm: int) -> None:
        """Let one sonar see something, or be faulty."""
        self.stack.vehicle.ranges[sonar] = mm
        self.stack.run(60)

    @rule(mm=RANGES_MM)
    def sonars(self, mm: int) -> None:
        """Let all sonars see the same."""
        self.stack.vehicle.ranges[:] = [mm] * 8
        self.stack.run(60)

    @rule(side=st.sampled_from(Side), bits=st.sampled_from([0, 1, 1 << 31]), ms=SHORT)
    def driver(self, side: Side, bits: int, ms: int) -> None:
        """Let a motor driver report a fault, or none."""
        self.stack.vehicle.fault(side, bits)
        self.stack.run(ms)

    @rule(linear=st.sampled_from([1.5, -1.5, 0.0, None]), ms=SHORT)
    def runaway(self, linear: float | None, ms: int) -> None:
        """Let the board measure another speed than it was told."""
        self.stack.vehicle.measured = None if linear is None else Twist(linear)
        self.stack.run(ms)

    @rule(on=st.booleans())
    def brakes(self, on: bool) -> None:
        """Switch one of the board's own brakes by the bridge's call."""
        with self.stack.time():
            self.stack.bridge.call(keys.SET_SWITCHES, m.SwitchesRequest(bumper_brake=on))
        self.stack.run(60)

    @rule(ms=SHORT | LONG)
    def freeze(self, ms: int) -> None:
        """Let the board hear and say nothing."""
        self.stack.vehicle.freeze(ms)
        self.stack.run(60)

    @rule(ms=st.sampled_from([300, 600, 1000]))
    def power_cycle(self, ms: int) -> None:
        """Start the board anew."""
        self.stack.power_cycle(ms)

    @rule(garbage=st.binary(max_size=40))
    def garbage(self, garbage: bytes) -> None:
        """Let the cable bring nonsense."""
        self.stack.vehicle.say_bytes(b"GS" + garbage)
        self.stack.run(5)

    # --- processes and what is between them -------------------------------------------------

    @rule(name=PROCESSES, ms=SHORT | LONG)
    def kill(self, name: str, ms: int) -> None:
        """Kill a process; another one starts later."""
        self.stack.kill(name, ms)
        self.stack.run(60)

    @rule(ms=SHORT | LONG)
    def hang_safety(self, ms: int) -> None:
        """Let safety do nothing, and then go on as if nothing was."""
        self.stack.hang("safety", ms)
        self.stack.run(60)

    @rule(ms=st.sampled_from([50, 120, 180]))
    def hang_bridge(self, ms: int) -> None:
        """Let the bridge do nothing, for less than its guard bears."""
        self.stack.hang("bridge", ms)
        self.judge.slack_ns = max(self.judge.slack_ns, ms * MS)
        self.stack.run(60)

    @rule(ms=SHORT | LONG)
    def router(self, ms: int) -> None:
        """Take the router away for a while."""
        self.stack.router(False)
        self.stack.run(ms)
        self.stack.router(True)
        self.stack.run(5)

    @rule(route=BUS, weather=ON_BUS, ms=SHORT)
    def bus_weather(self, route: str, weather: Weather, ms: int) -> None:
        """Let messages be late, lost, doubled or out of order."""
        self.stack.net.weather[route] = weather
        self.stack.run(ms)

    @rule(route=CABLE, weather=ON_CABLE, ms=SHORT)
    def cable_weather(self, route: str, weather: Weather, ms: int) -> None:
        """Let datagrams be late, lost or doubled; a cable keeps their order."""
        self.stack.net.weather[route] = weather
        # Every second one lost: a STOP of 20 Hz may be the third one that goes out.
        slack_ms = weather.late_ms + (100 if weather.lose else 0)
        self.judge.slack_ns = max(self.judge.slack_ns, slack_ms * MS)
        self.stack.run(ms)

    @rule(route=BUS, ms=SHORT)
    def cut(self, route: str, ms: int) -> None:
        """Let everything on one route get lost for a while."""
        before = self.stack.net.weather.get(route, CLEAR)
        self.bus_weather(route, Weather(lose=1), ms)
        self.stack.net.weather[route] = before

    @precondition(lambda self: self.stack.net.weather)
    @rule()
    def fine_weather(self) -> None:
        """Let everything arrive at once again."""
        self.stack.run(ECHO_MS + HOLD_MS + 120)
        self.stack.net.weather.clear()

    # --- hostile values ---------------------------------------------------------------------

    @rule(source=st.sampled_from(["teleop", "nav", "nobody"]), kind=st.sampled_from([*HOSTILE]))
    def hostile_request(self, source: str, kind: str) -> None:
        """Put a request that must not be taken."""
        stick = self.stack.sticks.get(source, self.stack.sticks["teleop"])
        bad = HOSTILE[kind]
        step = 0 if kind == "again" else 1
        stick.seq += step
        echo = stick.echo + bad.echo
        stick.put(replace(bad, echo=echo, seq=stick.seq), source)
        self.stack.run(5)

    @precondition(
        lambda self: self.judge.has_authority() and "motion" not in self.stack.net.weather
    )
    @rule(forged=st.sampled_from(FORGED), seq=st.integers(1, 2**40))
    def forged_motion(self, forged: m.Motion, seq: int) -> None:
        """Let somebody else publish motions while safety lives."""
        hand = self.stack.hand
        message = replace(forged, seq=seq)
        hand.send(Letter(keys.MOTION.on(ROBOT), message, hand.boot, hand.net.now_ns))
        self.stack.run(5)

    # --- the end ----------------------------------------------------------------------------

    @invariant()
    def no_frame_breaks_an_invariant(self) -> None:
        """Look at all frames since the last look."""
        violations = list(dict.fromkeys(self.judge.violations))[:5]
        assert not violations

    def teardown(self) -> None:
        """When everything falls silent, the vehicle is told to stop, and it stays so."""
        for stick in self.stack.sticks.values():
            stick.asks = None
        self.stack.kill("safety", 10_000)
        self.stack.run(1200)
        self.no_frame_breaks_an_invariant()


TestAnything = Anything.TestCase
TestAnything.settings = settings(
    max_examples=EXAMPLES or 80,
    stateful_step_count=20,
    derandomize=not EXAMPLES,
    # Making an example smaller takes minutes: more than a test may take.
    phases=list(Phase) if EXAMPLES else [Phase.explicit, Phase.generate],
    deadline=None,
    database=None,
    suppress_health_check=list(HealthCheck),
)


def test_time_goes_in_whole_steps() -> None:
    assert all(delay_ms * MS % STEP_NS == 0 for delay_ms in (ECHO_MS, HOLD_MS))
