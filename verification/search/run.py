"""One run: a draw, driven in simulated time, with its faults and verdicts."""

import gc
import math
import os
import time
import traceback
from collections import Counter
from collections.abc import Callable
from typing import Any

from msgspec import Struct

from common.freshness import NS_PER_S
from sim import requests as q
from t2 import keys
from t2 import messages as m
from verification.search.bus import MS, Disturbance
from verification.search.condition_books import BRAKING_RADPS2
from verification.search.draw import TURN_BRAKING, Draw, Value, room
from verification.search.draw import draw as drawn
from verification.search.judge import Judge, PoseError, Stop, pose_error
from verification.search.operator import Operator
from verification.search.stack import START_NS, Stack

STEP_NS = 10 * MS
ACT_MS = 50
LONGEST_S = 90.0
TAP_MS, TAPS, TAPS_S = 60, 6, 2.7  # the shortest press that counts, after the bounce
TAIL_MS = 1200  # after the script: everything must stand


class Result(Struct, frozen=True, kw_only=True):
    """Verdicts and figures of one run."""

    seed: int
    values: dict[str, Value]
    faulty: bool
    violations: list[str]  # of the invariants
    stops: list[Stop]  # that nothing justified; of runs without faults only
    finished: bool  # the script
    seconds: float  # simulated
    cpu_s: float
    metres: float  # driven
    contacts: int
    error: PoseError | None  # of odometry, at the end
    held: dict[str, float] = {}  # of an unfinished run: causes that held the vehicle, in seconds

    @property
    def completed(self) -> bool:
        """Whether the script was finished without a needless stop."""
        return self.finished and not self.stops


def prepare_worker() -> None:
    """Give way to other programs; collect garbage rarely, otherwise a fifth of the time."""
    os.nice(10)
    gc.set_threshold(50_000)


def run_seed(seed: int) -> Result:
    """Return the result of one seed; worker processes import it."""
    return run(drawn(seed))


def run(draw: Draw) -> Result:
    """Drive a draw; an error of a service is a violation."""
    began_s = time.process_time()
    trial = Trial(draw)
    stack, operator = trial.stack, trial.operator
    violations: list[str] = []
    try:
        trial.drive()
    except Exception as error:  # whatever a service raises would end it
        where = traceback.extract_tb(error.__traceback__)[-1]
        violations.append(f"{type(error).__name__} in {where.name}: {error}")
    violations += dict.fromkeys(stack.oracle.violations + operator.violations)
    finished = not operator.gave_up and operator.done
    return Result(
        seed=draw.seed,
        values=draw.values,
        faulty=draw.faulty,
        violations=violations,
        stops=[] if draw.faulty else trial.judge.stops,
        finished=finished,
        seconds=round((stack.net.now_ns - START_NS) / NS_PER_S, 2),
        cpu_s=round(time.process_time() - began_s, 3),
        metres=round(stack.vehicle.truth.distance, 3),
        contacts=trial.contacts,
        error=trial.pose_error(),
        held={} if finished else trial.held(),
    )


class Trial:
    """The run under way."""

    def __init__(self, draw: Draw) -> None:
        model = draw.model()
        plan = room(draw, model.vehicle)
        turn_braking = float(draw.get(TURN_BRAKING, BRAKING_RADPS2))
        self.stack = Stack(model, plan, seed=draw.seed, step_ns=STEP_NS, turn_braking=turn_braking)
        self.operator = Operator(self.stack, draw)
        self.stack.sources["teleop"] = self.operator
        self.judge = Judge(START_NS)
        self.contacts = 0
        self.bounce_ms = math.ceil(model.bumper.bounce * 1000)
        self._origin = self.stack.vehicle.simulation.pose
        self._odometry: m.Odometry | None = None
        self._faults = sorted(
            (
                (START_NS + round((float(value) + after_s) * NS_PER_S), number, step)
                for name, value in draw.values.items()
                for number, (after_s, step) in enumerate(FAULTS.get(name, ()))
            ),
            key=lambda fault: fault[:2],
        )
        self._held: Counter[str] = Counter()  # looks at each cause
        self.stack.hand.subscribe(keys.ODOMETRY, self._on_odometry)

    def drive(self) -> None:
        """Run until the script is finished, then let the vehicle stand."""
        end_ns = START_NS + round(LONGEST_S * NS_PER_S)
        while not self.operator.done and self.stack.net.now_ns < end_ns:
            while self._faults and self._faults[0][0] <= self.stack.net.now_ns:
                self._faults.pop(0)[2](self)
            self.operator.act()
            self._advance()
        self.operator.muted_until_ns = math.inf
        for _ in range(TAIL_MS // ACT_MS):
            self._advance()

    def held(self) -> dict[str, float]:
        """Return the causes that operators saw, and for how many seconds; the longest first."""
        return {name: count * ACT_MS / 1000 for name, count in self._held.most_common()}

    def pose_error(self) -> PoseError | None:
        """Return the error of the newest odometry."""
        if self._odometry is None:
            return None
        pose = self.stack.vehicle.simulation.pose
        return pose_error(self._odometry, pose, self._origin)

    def _advance(self) -> None:
        """Advance to the next act."""
        stack, before = self.stack, self.stack.vehicle.truth
        stack.run(ACT_MS - stack.net.now_ns // MS % ACT_MS)
        truth, causes = stack.vehicle.truth, stack.seen.causes if stack.seen else ()
        self.contacts += truth.contact and not before.contact
        self.judge.look(causes, self.operator.asks_since_ns, truth, stack.net.now_ns)
        self._held.update(cause.name for cause in causes)

    def _on_odometry(self, arrival: Any) -> None:
        self._odometry = arrival.message


# --- faults -----------------------------------------------------------------------------------

Step = Callable[[Any], None]  # of a trial


def _inject(request: q.Asked) -> Step:
    return lambda trial: trial.stack.vehicle.inject(request)


def _mute(report: q.ReportName, seconds: float) -> tuple[tuple[float, Step], ...]:
    return (0.0, _inject(q.Mute(reports=(report,)))), (seconds, _inject(q.Mute()))


def _tap(trial: Trial) -> None:
    trial.stack.tap(TAP_MS + trial.bounce_ms)


def _silence(trial: Trial) -> None:
    trial.operator.muted_until_ns = trial.stack.net.now_ns + NS_PER_S


def _freeze(frozen: bool) -> Step:
    return lambda trial: trial.operator.freeze(frozen)


def _late(trial: Trial) -> None:
    trial.stack.net.disturbances["drive"] = Disturbance(late_ms=400, lose=3)


# Steps of each fault of ``ranges.toml``: seconds after its begin, and what happens.
FAULTS: dict[str, tuple[tuple[float, Step], ...]] = {
    "fault.bridge_killed": ((0.0, lambda trial: trial.stack.kill("bridge", 200)),),
    "fault.safety_killed": ((0.0, lambda trial: trial.stack.kill("safety", 200)),),
    "fault.bridge_stalled": ((0.0, lambda trial: trial.stack.stall("bridge", 150)),),
    "fault.safety_stalled": ((0.0, lambda trial: trial.stack.stall("safety", 400)),),
    "fault.router_down": (
        (0.0, lambda trial: trial.stack.router(False)),
        (1.0, lambda trial: trial.stack.router(True)),
    ),
    "fault.operator_silent": ((0.0, _silence),),
    "fault.gamepad_frozen": ((0.0, _freeze(True)), (4.0, _freeze(False))),
    "fault.requests_late": (
        (0.0, _late),
        (0.5, lambda trial: trial.stack.net.disturbances.clear()),
    ),
    "fault.estop": ((0.0, lambda trial: trial.stack.estop()),),
    "fault.board_frozen": ((0.0, _inject(q.Freeze(seconds=0.6))),),
    "fault.board_restarted": ((0.0, _inject(q.PowerCycle(seconds=0.8))),),
    "fault.bumper_pressed": (
        (0.0, _inject(q.Bumper(pressed=True))),
        (0.1, _inject(q.Bumper(pressed=False))),
    ),
    "fault.bumper_tapped": tuple((number * TAPS_S, _tap) for number in range(TAPS)),
    "fault.bumper_muted": _mute("bumper", 0.5),
    "fault.velocity_muted": _mute("velocity", 0.5),
    "fault.ultrasonic_muted": _mute("ultrasonic", 0.8),
    "fault.driver": (
        (0.0, _inject(q.Driver(side="left", bits=1))),
        (0.5, _inject(q.Driver(side="left", bits=0))),
    ),
    "fault.sonar_faulty": ((0.0, _inject(q.Sonar(name="front", fault=True))),),
    "fault.sonar_stuck": ((0.0, _inject(q.Sonar(name="front", stuck=True))),),
}
