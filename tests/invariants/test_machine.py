"""StackMachine in any order: no frame that the board receives breaks an invariant.

In CI the search is the same each time. A longer one, another each time, half a second an example:

    T2_EXAMPLES=3000 .venv/bin/pytest --timeout 0 tests/invariants
"""

import os

import pytest
from hypothesis import HealthCheck, Phase, seed, settings
from hypothesis import strategies as st
from hypothesis.stateful import initialize, invariant, rule, run_state_machine_as_test

from common import messages as m
from common.wire.frame import Side
from tests.invariants.fault_rules import FaultRules
from tests.invariants.strategies import (
    BUS,
    CAPS,
    DIRECTIONS,
    FAST,
    HASTY,
    KINDS,
    LIMITERS,
    LONG,
    NEAR_MM,
    ON_BUS,
    SHORT,
    SOURCES,
    SPEEDS,
    TURNS,
)
from verification.invariants.limits import IGNORED, NEEDED
from verification.invariants.net import ECHO_MS, HOLD_MS, MS, Disturbance
from verification.invariants.oracle import STEP_NS
from verification.invariants.vehicle import NO_ECHO_MM

PATIENCE = 3  # rules
SEEDS, EXAMPLES_PER_SEED = 8, 9
EXAMPLES = int(os.environ.get("T2_EXAMPLES", "0"))


class StackMachine(FaultRules):
    """Rules for operators, besides all faults; the oracle checks every frame at the board."""

    def __init__(self) -> None:
        super().__init__()
        self.cured = self.idle = 0

    @initialize(under_way=st.sampled_from([True, True, True, False]))
    def begin(self, under_way: bool) -> None:
        """Come up, and most often drive at once."""
        self.stack.run(700)
        if under_way:
            self.off_we_go("teleop", 1.0, 0.0, 600)

    # --- people -----------------------------------------------------------------------------

    @rule(source=SOURCES, linear=SPEEDS, angular=TURNS, ms=SHORT | LONG)
    def off_we_go(self, source: str, linear: float, angular: float, ms: int) -> None:
        """Ask for zero until inputs have settled, then for motion: the way it is meant."""
        self.stack.sticks[source].requested = (0.0, 0.0)
        self.stack.run(650)
        self.drive(source, linear, angular, ms)

    # Hypothesis draws the first rule most often: that of the fewest arguments and the first name.
    @rule(linear=FAST)
    def ahead(self, linear: float) -> None:
        """Ask for motion without a neutral request, as someone who noticed nothing does."""
        self.drive("teleop", linear, 0.0, 210)

    def cure(self) -> None:
        """Cure everything, reset, and drive: there must be something at stake."""
        vehicle = self.stack.vehicle
        vehicle.pressed, vehicle.measured, vehicle.reports_velocity = False, None, True
        vehicle.ranges[:] = [NO_ECHO_MM] * 8
        for side in Side:
            vehicle.fault(side, 0)
        self.stack.net.disturbances.clear()
        self.stack.limiters[NEEDED].caps, self.stack.limiters[IGNORED].caps = (None, None), None
        self.wait(1000)
        self.brakes(on=True)
        self.reset(lets_go=True)
        self.off_we_go("teleop", -1.0 if self.cured % 2 else 1.0, 0.0, 700)
        self.cured += 1

    @rule(kind=KINDS, ms=LONG, dies=st.sampled_from(["nobody", "safety", "bridge"]))
    def insist(self, kind: str, ms: int, dies: str) -> None:
        """Trip something, cure it at once, and drive on without a reset; safety may die of it."""
        self.trip(kind)
        if dies != "nobody":
            self.stack.kill(dies, 20)
        self.wait(ms)
        self.off_we_go("teleop", 1.0, 0.0, ms)

    @rule(kind=KINDS, gone_ms=HASTY, requested=st.booleans())
    def hasty_reset(self, kind: str, gone_ms: int, requested: bool) -> None:
        """Trip something, cure it, and reset too early or with the stick still pushed."""
        self.trip(kind)
        self.stack.sticks["teleop"].requested = (0.5, 0.0) if requested else (0.0, 0.0)
        self.stack.run(gone_ms)
        self.stack.reset()
        self.off_we_go("teleop", 1.0, 0.0, 400)

    @rule(first=KINDS, then=KINDS, ms=st.sampled_from([20, 210, 700, 1200]))
    def late_reset(self, first: str, then: str, ms: int) -> None:
        """Trip something, trip more, and let the reset of the first arrive after that."""
        self.trip(first)
        self.let_go("teleop", 400)
        seen = self.stack.seen
        self.trip(then)
        self.stack.run(ms)
        self.stack.reset(seen)
        self.off_we_go("teleop", 1.0, 0.0, 400)

    @rule(direction=DIRECTIONS, ms=SHORT | LONG, times=st.integers(1, 8))
    def late_release(self, direction: m.Direction, ms: int, times: int) -> None:
        """Deliver calls that hold the release late, all at once, and perhaps after its end."""
        seen = self.stack.seen
        self.release(times // 2, direction)
        self.stack.hold(False)
        self.stack.run(ms)
        for _ in range(times):
            self.stack.hold(True, direction, seen)
            self.stack.run(20)

    @rule(direction=DIRECTIONS, other=DIRECTIONS, ms=st.sampled_from([20, 60, 150, 700]))
    def pressed_again(self, direction: m.Direction, other: m.Direction, ms: int) -> None:
        """Drive into something, get off it, and touch something again on the way."""
        self.off_we_go("teleop", 1.0, 0.0, 400)
        self.stack.vehicle.pressed = True
        self.let_go("teleop", 1200)
        self.release(6, direction)
        self.bumper(pressed=False, ms=ms)
        self.bumper(pressed=True, ms=ms)
        self.release(6, direction)
        self.release(12, other)
        self.bumper(pressed=False, ms=320)

    @rule(kind=KINDS, resets=st.booleans(), dies=st.booleans())
    def stuck(self, kind: str, resets: bool, dies: bool) -> None:
        """Drive into something, with more amiss, and creep off with or without a reset."""
        self.off_we_go("teleop", 1.0, 0.0, 400)
        self.stack.vehicle.pressed = True
        self.trip("estop" if kind == "bumper" else kind)
        if dies:
            self.stack.kill("safety", 20)
        self.let_go("teleop", 1200)
        self.release(2, "backward")
        if resets:
            self.stack.reset()
        self.release(6, "backward")
        self.bumper(pressed=False, ms=320)

    @rule(linear=FAST, route=BUS, disturbance=ON_BUS, hits=st.booleans())
    def storm(self, linear: float, route: str, disturbance: Disturbance, hits: bool) -> None:
        """Drive under a disturbance, perhaps hit something, and end it."""
        self.off_we_go("teleop", linear, 0.0, 400)
        self.bus_disturbance(route, disturbance, 210)
        self.bumper(pressed=hits, ms=60)
        self.end_disturbances(settled=False)
        self.stack.run(210)

    @rule(linear=FAST, gap_ms=st.sampled_from([450, 600, 1200]))
    def burst(self, linear: float, gap_ms: int) -> None:
        """Silence a source, then deliver its old requests all at once."""
        stick = self.stack.sticks["teleop"]
        stick.requested, echo = None, stick.echo
        self.stack.run(gap_ms)
        for speed in [0.0] * 5 + [linear] * 10:
            stick.seq += 1
            stick.put(m.Drive(linear=speed, angular=0.0, echo=echo, seq=stick.seq))
            self.stack.run(10)

    @rule(source=LIMITERS, linear=FAST, cap=CAPS, ms=LONG)
    def limited(self, source: str, linear: float, cap: float | None, ms: int) -> None:
        """Drive fast, then limit the speed, and end the limit while the stick is pushed."""
        self.off_we_go("teleop", linear, 0.4, 700)
        self.limit(source, cap, None, ms)
        self.limit(source, None, None, 400)

    @rule(source=SOURCES, linear=FAST, mm=NEAR_MM, ms=LONG)
    def approach(self, source: str, linear: float, mm: int, ms: int) -> None:
        """Drive on while something is near all around, as far as safety lets it."""
        self.stack.vehicle.ranges[:] = [mm] * 8
        self.off_we_go(source, linear, 0.0, ms)

    @rule(source=SOURCES, linear=SPEEDS, angular=TURNS, ms=SHORT)
    def drive(self, source: str, linear: float, angular: float, ms: int) -> None:
        """Ask for something, and go on asking."""
        self.stack.sticks[source].requested = (linear, angular)
        self.stack.run(ms)

    @rule(source=SOURCES, ms=SHORT | LONG)
    def let_go(self, source: str, ms: int) -> None:
        """Stop requesting, as a source that has died."""
        self.stack.sticks[source].requested = None
        self.stack.run(ms)

    @rule(ms=SHORT | LONG)
    def wait(self, ms: int) -> None:
        """Advance the time."""
        self.stack.run(ms)

    @rule(ms=SHORT)
    def estop(self, ms: int) -> None:
        """Press the emergency stop."""
        self.stack.estop()
        self.stack.run(ms)

    @rule(lets_go=st.booleans())
    def reset(self, lets_go: bool) -> None:
        """Ask for a reset, with the controls released or not."""
        if lets_go:
            for stick in self.stack.sticks.values():
                stick.requested = None
            self.stack.run(500)
        self.stack.reset()

    @rule(times=st.integers(1, 8), direction=DIRECTIONS)
    def release(self, times: int, direction: m.Direction) -> None:
        """Hold the release for a while."""
        for _ in range(times):
            self.stack.hold(True, direction)
            self.stack.run(60)

    # --- the end ----------------------------------------------------------------------------

    @invariant()
    def no_frame_breaks_an_invariant(self) -> None:
        """Check all frames since the last check."""
        violations = list(dict.fromkeys(self.oracle.violations))[:5]
        assert not violations

    @invariant()
    def nobody_stands_for_long(self) -> None:
        """Cure everything after some rules without motion; what was wrong was wrong for long."""
        moves = abs(self.stack.vehicle.twist.linear) > 0.05
        self.idle = 0 if moves else self.idle + 1
        if self.idle > PATIENCE:
            self.cure()
            self.no_frame_breaks_an_invariant()

    def teardown(self) -> None:
        """When all sources fall silent, the vehicle is stopped and stays stopped."""
        for stick in self.stack.sticks.values():
            stick.requested = None
        self.stack.kill("safety", 10_000)
        self.stack.run(1200)
        self.no_frame_breaks_an_invariant()


def search(examples: int, phases: list[Phase], machine: type[StackMachine]) -> None:
    """Run a state machine with so many examples."""
    run_state_machine_as_test(
        machine,
        settings=settings(
            max_examples=examples,
            stateful_step_count=20,
            phases=phases,
            deadline=None,
            database=None,
            suppress_health_check=list(HealthCheck),
        ),
    )


@pytest.mark.parametrize("number", range(SEEDS))
def test_no_order_of_events_breaks_an_invariant(number: int) -> None:
    # Hypothesis draws its first ten examples afresh and varies them from there on: few examples
    # of many seeds are more different than many of one.
    machine = seed(number)(type(f"StackMachine{number}", (StackMachine,), {}))
    # Making an example smaller takes minutes: more than a test may take.
    search(EXAMPLES_PER_SEED, [Phase.generate], machine)


@pytest.mark.skipif(not EXAMPLES, reason="a longer search: say T2_EXAMPLES=3000, --timeout 0")
def test_no_order_of_events_breaks_an_invariant_for_long() -> None:
    search(EXAMPLES, list(Phase), StackMachine)


def test_time_goes_in_whole_steps() -> None:
    assert all(delay_ms * MS % STEP_NS == 0 for delay_ms in (ECHO_MS, HOLD_MS))
