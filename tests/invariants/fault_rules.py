"""Fault rules: sensors, board, processes, bus and hostile messages; operators: ``test_machine``."""

from typing import Any

from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, precondition, rule
from msgspec.structs import replace

from common import keys
from common import messages as m
from common.motion import Twist
from common.wire.frame import Side
from tests.invariants.strategies import (
    BUS,
    CABLE,
    CAPS,
    FORGED,
    HOSTILE,
    HOSTILE_LIMITS,
    LIMITERS,
    LONG,
    ON_BUS,
    ON_CABLE,
    PROCESSES,
    RANGES_MM,
    SHORT,
)
from verification.invariants.net import CLEAR, ECHO_MS, HOLD_MS, MS, Disturbance, Envelope
from verification.invariants.process import ROBOT
from verification.invariants.stack import Stack


class FaultRules(RuleBasedStateMachine):
    """Rules for faults of sensors, board, processes, bus and cable, and for forged messages."""

    def __init__(self) -> None:
        super().__init__()
        self.stack = Stack()
        self.oracle = self.stack.oracle

    # --- what the board sees ----------------------------------------------------------------

    @rule(pressed=st.booleans(), ms=SHORT)
    def bumper(self, pressed: bool, ms: int) -> None:
        """Press the bumper, or free it."""
        self.stack.vehicle.pressed = pressed
        self.stack.run(ms)

    @rule(sonar=st.integers(0, 7), mm=RANGES_MM)
    def sonar(self, sonar: int, mm: int) -> None:
        """Set the range of one sonar, or a fault."""
        self.stack.vehicle.ranges[sonar] = mm
        self.stack.run(60)

    @rule(mm=RANGES_MM)
    def sonars(self, mm: int) -> None:
        """Set the range of all sonars."""
        self.stack.vehicle.ranges[:] = [mm] * 8
        self.stack.run(60)

    @rule(side=st.sampled_from(Side), bits=st.sampled_from([0, 1, 1 << 31]), ms=SHORT)
    def driver(self, side: Side, bits: int, ms: int) -> None:
        """Report a fault of a motor driver, or its end."""
        self.stack.vehicle.fault(side, bits)
        self.stack.run(ms)

    @rule(linear=st.sampled_from([1.5, -1.5, 0.0, None]), ms=SHORT)
    def runaway(self, linear: float | None, ms: int) -> None:
        """Report a measured speed that differs from the command."""
        self.stack.vehicle.measured = None if linear is None else Twist(linear)
        self.stack.run(ms)

    @rule(reports=st.booleans(), ms=SHORT | LONG)
    def velocities(self, reports: bool, ms: int) -> None:
        """Stop or resume the velocity reports."""
        self.stack.vehicle.reports_velocity = reports
        self.stack.run(ms)

    @rule(on=st.booleans())
    def brakes(self, on: bool) -> None:
        """Switch one of the board's own brakes by the bridge's call."""
        self.stack.switches(on=on)
        self.stack.run(60)

    @rule(source=LIMITERS, linear=CAPS, angular=CAPS, ms=SHORT | LONG)
    def limit(self, source: str, linear: float | None, angular: float | None, ms: int) -> None:
        """Limit the speed from now on."""
        self.stack.limiters[source].caps = linear, angular
        self.stack.run(ms)

    @rule(source=LIMITERS, ms=SHORT | LONG)
    def silence_limit(self, source: str, ms: int) -> None:
        """Silence a source of limits for a while."""
        limiter = self.stack.limiters[source]
        before, limiter.caps = limiter.caps, None
        self.stack.run(ms)
        limiter.caps = before

    @rule(ms=st.sampled_from([400, 900, 1000, 1005, 1100, 2000]))
    def silence_pendant(self, ms: int) -> None:
        """Silence the pendant for a while."""
        self.stack.pendant.alive = False
        self.stack.run(ms)
        self.stack.pendant.alive = True

    @rule(late=st.integers(0, 40), boot=st.sampled_from([0, 0, 7]))
    def hostile_keepalive(self, late: int, boot: int) -> None:
        """Send a sign of life with an old echo, or of another program."""
        pendant = self.stack.pendant
        pendant.put(m.EstopKeepalive(echo=pendant.echo - late, boot=boot))
        self.stack.run(5)

    def trip(self, kind: str) -> None:
        """Trip a latch whose cause ends at once."""
        vehicle = self.stack.vehicle
        if kind == "estop":
            self.stack.estop()
        elif kind == "bumper":
            self.bumper(pressed=True, ms=60)
            vehicle.pressed = False
        elif kind == "driver":
            self.driver(Side.LEFT, 1 << 31, 60)
            vehicle.fault(Side.LEFT, 0)
        elif kind == "router":
            self.router(60)
        else:
            self.runaway(1.5, 700)
            vehicle.measured = None

    @rule(ms=SHORT | LONG)
    def freeze(self, ms: int) -> None:
        """Freeze the board: it neither receives nor sends."""
        self.stack.vehicle.freeze(ms)
        self.stack.run(60)

    @rule(ms=st.sampled_from([300, 600, 1000]))
    def power_cycle(self, ms: int) -> None:
        """Restart the board."""
        self.stack.power_cycle(ms)

    @rule(garbage=st.binary(max_size=40))
    def garbage(self, garbage: bytes) -> None:
        """Send garbage to the bridge."""
        self.stack.vehicle.say_bytes(b"GS" + garbage)
        self.stack.run(5)

    # --- processes and what is between them -------------------------------------------------

    @rule(name=PROCESSES, ms=SHORT | LONG)
    def kill(self, name: str, ms: int) -> None:
        """Kill a process; another one starts later."""
        self.stack.kill(name, ms)
        self.stack.run(60)

    @rule(ms=SHORT | LONG, estop_ms=st.none() | SHORT)
    def stall_safety(self, ms: int, estop_ms: int | None) -> None:
        """Stall safety; perhaps press the emergency stop meanwhile."""
        self.stack.stall("safety", ms)
        self.stack.run(60)
        if estop_ms is not None:
            self.stack.run(estop_ms)
            self.stack.estop()

    @rule(ms=st.sampled_from([50, 120, 180]))
    def stall_bridge(self, ms: int) -> None:
        """Stall the bridge for less than its guard's limit."""
        self.stack.stall("bridge", ms)
        self.oracle.slack_ns = max(self.oracle.slack_ns, ms * MS)
        self.stack.run(60)

    @rule(ms=SHORT | LONG)
    def router(self, ms: int) -> None:
        """Take the router away for a while."""
        self.stack.router(False)
        self.stack.run(ms)
        self.stack.router(True)
        self.stack.run(5)

    @rule()
    def blink(self) -> None:
        """Take the router away between two decisions."""
        self.router(0)

    @rule(route=BUS, disturbance=ON_BUS, ms=SHORT)
    def bus_disturbance(self, route: str, disturbance: Disturbance, ms: int) -> None:
        """Delay, lose, duplicate or reorder messages."""
        self.stack.net.disturbances[route] = disturbance
        self.stack.run(ms)

    @rule(route=CABLE, disturbance=ON_CABLE, ms=SHORT)
    def cable_disturbance(self, route: str, disturbance: Disturbance, ms: int) -> None:
        """Delay, lose or duplicate datagrams; a cable keeps their order."""
        self.stack.net.disturbances[route] = disturbance
        # Every second one lost: a STOP of 20 Hz may be the third one that goes out.
        slack_ms = disturbance.late_ms + (100 if disturbance.lose else 0)
        self.oracle.slack_ns = max(self.oracle.slack_ns, slack_ms * MS)
        self.stack.run(ms)

    @rule(route=BUS, ms=SHORT)
    def cut(self, route: str, ms: int) -> None:
        """Lose everything on one route for a while."""
        before = self.stack.net.disturbances.get(route, CLEAR)
        self.bus_disturbance(route, Disturbance(lose=1), ms)
        self.stack.net.disturbances[route] = before

    @precondition(lambda self: self.stack.net.disturbances)
    @rule(settled=st.booleans())
    def end_disturbances(self, settled: bool) -> None:
        """End all disturbances, before or after delayed messages arrive."""
        self.stack.run(ECHO_MS + HOLD_MS + 120 if settled else 0)
        self.stack.net.disturbances.clear()

    # --- hostile values ---------------------------------------------------------------------

    @rule(source=st.sampled_from(["teleop", "nav", "nobody"]), kind=st.sampled_from([*HOSTILE]))
    def hostile_request(self, source: str, kind: str) -> None:
        """Send a request that safety must refuse."""
        stick = self.stack.sticks.get(source, self.stack.sticks["teleop"])
        bad = HOSTILE[kind]
        step = 0 if kind == "again" else 1
        stick.seq += step
        echo = stick.echo + bad.echo
        stick.put(replace(bad, echo=echo, seq=stick.seq), source)
        self.stack.run(5)

    @rule(source=LIMITERS, kind=st.sampled_from([*HOSTILE_LIMITS]))
    def hostile_limit(self, source: str, kind: str) -> None:
        """Send a limit that safety must refuse."""
        limiter, bad = self.stack.limiters[source], HOSTILE_LIMITS[kind]
        limiter.put(replace(bad, echo=limiter.echo + bad.echo))
        self.stack.run(5)

    @rule(forged=st.sampled_from(FORGED), seq=st.integers(1, 2**62), copies=st.booleans())
    def forged_motion(self, forged: list[m.Motion], seq: int, copies: bool) -> None:
        """Publish motions as a client of the router, with safety's boot or another."""
        boot = self.stack.safety.boot if copies else 1
        for step, motion in enumerate(forged):
            self.forge(keys.MOTION, replace(motion, seq=seq + step, boot=boot))
        self.stack.run(5)

    @rule(pressed=st.booleans(), linear=st.sampled_from([0.0, 3.0]), seq=st.integers(1, 2**62))
    def forged_samples(self, pressed: bool, linear: float, seq: int) -> None:
        """Publish measurements as a client of the router, with the bridge's boot."""
        boot = self.stack.bridge.boot
        self.forge(keys.BUMPER, m.Bumper(pressed=pressed, seq=seq, boot=boot))
        self.forge(keys.VELOCITY, m.Velocity(linear=linear, angular=0.0, seq=seq, boot=boot))
        self.stack.run(60)

    def forge(self, topic: keys.Topic[Any], message: m.Message) -> None:
        """Put a message as a client without a drive link."""
        hand = self.stack.hand
        hand.send(Envelope(topic.on(ROBOT), message, hand.boot, hand.net.now_ns))
