"""One vehicle that drives one round in simulated time, and what the truth says of it."""

import math
import random
import tempfile
import time
import traceback
from collections.abc import Callable
from pathlib import Path

from msgspec import Struct

from common.freshness import NS_PER_S
from sim import requests as q
from sim.geometry import Pose
from t2 import messages as m
from verification.localization.source import FixSource
from verification.patrol.attendant import UNCERTAIN, Attendant
from verification.patrol.draw import Person, scene
from verification.patrol.judge import Judge
from verification.patrol.robot import Robot
from verification.search.draw import Draw, draw
from verification.search.run import FAULTS
from verification.search.stack import START_NS

TICK_MS, LOOK_MS, TAIL_TICKS = 100, 50, 12
LONGEST_S = 400.0
LATER = 4.0  # faults of the search come this many times later: a round is longer
OF_TELEOP = ("fault.operator_silent", "fault.gamepad_frozen")
ASIDE = 1.5  # m beside the way, where a person begins to walk
NEUTRAL = m.Drive(linear=0.0, angular=0.0, echo=0)


class Result(Struct, frozen=True, kw_only=True):
    """How the round of one vehicle ended, by the truth."""

    seed: int
    faulty: bool
    blind: bool  # without a source of fixes
    result: str  # of the round, or the state in which it ended
    why: str
    broken: tuple[str, ...]
    deviation: float  # m, true, at worst while motion was requested
    corridor: float  # m
    claims: str
    from_home: float  # m, true
    seconds: float
    cpu_s: float
    actions: tuple[str, ...]

    @property
    def is_home(self) -> bool:
        return self.result == "home" and self.from_home <= self.corridor

    @property
    def unexpected(self) -> tuple[str, ...]:
        """How a round without a fault ended that must not end so."""
        honest = self.blind and self.result == "stopped" and self.why in UNCERTAIN
        if self.faulty or self.is_home or honest:
            return ()
        ended = f"{self.result}, {self.from_home:.2f} m from home: {self.why}"
        return (f"{ended} ({'; '.join(self.actions[-1:])})",)


Step = Callable[["Trial"], None]


class Trial:
    """The run under way."""

    def __init__(self, drawn: Draw, folder: Path) -> None:
        self.scene = scene(drawn.seed, faulty=drawn.faulty)
        self.stack = Robot(drawn, self.scene, folder)
        self.judge = Judge(self.stack, self.scene.route)
        chance = random.Random(f"{drawn.seed} attendant")
        of = self.scene.source
        self.fixes = FixSource(of, self.stack, chance) if of else None
        self.attendant = Attendant(self.stack, self.judge, chance, places=of is not None)
        self.bounce_ms = math.ceil(drawn.model().bumper.bounce * 1000)
        self.chance = chance
        self._due: list[tuple[float, int, Step]] = []  # s after the start of the round
        begins = {
            name: LATER * float(drawn.get(name, 0)) for name in FAULTS if name in drawn.values
        }
        for name, at_s in (*begins.items(), *self.scene.incidents.items()):
            for after_s, step in () if name in OF_TELEOP else (FAULTS | INCIDENTS)[name]:
                self.add(at_s + after_s, step)
        for person in self.scene.people:
            self.add(person.at, _walks(person))

    def add(self, at_s: float, step: Step) -> None:
        """Let something happen so many seconds after the start of the round."""
        self._due.append((at_s, len(self._due), step))
        self._due.sort(key=lambda due: due[:2])

    def drive(self, longest_s: float = LONGEST_S) -> None:
        """Run until the round is over, or a person gives up."""
        stack, began_ns, tick = self.stack, 0, 0
        while not self.is_over and stack.net.now_ns < START_NS + longest_s * NS_PER_S:
            began_ns = began_ns or (stack.net.now_ns if self.attendant.is_started else 0)
            at_s = (stack.net.now_ns - began_ns) / NS_PER_S if began_ns else -1.0
            while self._due and self._due[0][0] <= at_s:
                self._due.pop(0)[2](self)
            self.attendant.act()
            self._advance(tick)
            tick += 1
        for _ in range(TAIL_TICKS):
            self._advance(tick)

    @property
    def is_over(self) -> bool:
        state = self.judge.state
        is_done = self.attendant.is_started and state is not None and state.state == "done"
        return is_done or bool(self.attendant.gave_up)

    def _advance(self, tick: int) -> None:
        if self.fixes is not None:
            self.fixes.measure(tick)
        for _ in range(TICK_MS // LOOK_MS):
            self.stack.run(LOOK_MS)
            self.judge.look()


def measure(seed: int) -> Result:
    """Drive one vehicle; an error of a service breaks the proof."""
    began_s, drawn = time.process_time(), draw(seed)
    broken: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        trial = Trial(drawn, Path(folder))
        try:
            trial.drive()
        except Exception as error:  # whatever a service raises would end it
            where = traceback.extract_tb(error.__traceback__)[-1]
            broken.append(f"{type(error).__name__} in {where.name}: {error}")
    judge, state = trial.judge, trial.judge.state
    why = state.phrases[0].name if state and state.phrases else ""
    ended = state.state if state else "silent"
    return Result(
        seed=seed,
        faulty=drawn.faulty,
        blind=trial.scene.source is None,
        result=why.removeprefix("patrol.") if ended == "done" else ended,
        why=trial.attendant.gave_up or why,
        broken=tuple(dict.fromkeys(broken + trial.stack.oracle.violations + judge.violations)),
        deviation=judge.deviation,
        corridor=trial.scene.route.corridor,
        claims=judge.claims,
        from_home=judge.from_home,
        seconds=(trial.stack.net.now_ns - START_NS) / NS_PER_S,
        cpu_s=time.process_time() - began_s,
        actions=tuple(trial.attendant.actions),
    )


# --- incidents --------------------------------------------------------------------------------


def _kill(name: str) -> Step:
    return lambda trial: trial.stack.kill(name, 300)


def _stall(name: str) -> Step:
    return lambda trial: trial.stack.stall(name, trial.chance.choice((400, 1500, 4000)))


def _teleop(message: m.Drive | None) -> Step:
    def request(trial: Trial) -> None:
        trial.stack.sources["teleop"].message = message

    return request


def _walks(person: Person) -> Step:
    """Return the step at which a person appears before the vehicle, or beside its way."""

    def appear(trial: Trial) -> None:
        truth = trial.stack.vehicle.simulation.pose
        here = Pose(truth.x, truth.y, truth.heading)
        x, y = here.outward(person.ahead, ASIDE if person.speed else 0.0)
        heading = math.remainder(truth.heading - math.pi / 2, math.tau)
        request = q.Person(x=x, y=y, heading=heading, speed=person.speed, seconds=person.seconds)
        trial.stack.vehicle.inject(request)

    return appear


INCIDENTS: dict[str, tuple[tuple[float, Step], ...]] = {
    "localization_killed": ((0.0, _kill("localization")),),
    "odom_killed": ((0.0, _kill("odom")),),
    "patrol_killed": ((0.0, _kill("patrol")),),
    "localization_stalled": ((0.0, _stall("localization")),),
    "odom_stalled": ((0.0, _stall("odom")),),
    "patrol_stalled": ((0.0, _stall("patrol")),),
    "takeover": (
        (0.0, _teleop(NEUTRAL)),
        (0.5, _teleop(m.Drive(linear=0.2, angular=0.3, echo=0))),
        (2.0, _teleop(NEUTRAL)),
        (2.5, _teleop(None)),
    ),
}
