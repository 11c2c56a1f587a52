"""One run: a draw, driven in simulated time, with its verdicts."""

import math
import time
import traceback
from collections import Counter
from collections.abc import Callable

from msgspec import Struct

from common.freshness import NS_PER_S
from verification.invariants.net import MS
from verification.vehicles.chain import VehicleChain
from verification.vehicles.draw import Draw, Value
from verification.vehicles.faults import FaultSchedule
from verification.vehicles.judge import Judge, PoseError, Stop

ACT_MS = 50
LONGEST_S = 90.0
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
    errors: list[PoseError]  # once a second
    held: dict[str, float] = {}  # of an unfinished run: causes that held the vehicle, in seconds

    @property
    def completed(self) -> bool:
        """Whether the script was finished without a needless stop."""
        return self.finished and not self.stops


def run(draw: Draw) -> Result:
    """Drive a draw; an error of a service is a violation."""
    began_s = time.process_time()
    chain = VehicleChain(draw)
    trial = Trial(chain, draw)
    violations: list[str] = []
    try:
        trial.drive()
    except Exception as error:  # whatever a service raises would end it
        where = traceback.extract_tb(error.__traceback__)[-1]
        violations.append(f"{type(error).__name__} in {where.name}: {error}")
    violations += dict.fromkeys(chain.oracle.violations)
    finished = not chain.operator.gave_up and chain.operator.done
    return Result(
        seed=draw.seed,
        values=draw.values,
        faulty=draw.faulty,
        violations=violations,
        stops=[] if draw.faulty else trial.judge.stops,
        finished=finished,
        seconds=round((chain.net.now_ns - trial.start_ns) / NS_PER_S, 2),
        cpu_s=round(time.process_time() - began_s, 3),
        metres=round(chain.vehicle.truth.distance, 3),
        contacts=trial.contacts,
        errors=chain.errors,
        held={} if finished else trial.held(),
    )


class Trial:
    """The run under way."""

    def __init__(self, chain: VehicleChain, draw: Draw) -> None:
        self.chain = chain
        self.start_ns = chain.net.now_ns
        self.judge = Judge(self.start_ns)
        self.contacts = 0
        self._faults = FaultSchedule(draw, self.start_ns)
        self._held: Counter[str] = Counter()  # looks at each cause

    def drive(self) -> None:
        """Run until the script is finished, then let the vehicle stand."""
        chain = self.chain
        end_ns = self.start_ns + round(LONGEST_S * NS_PER_S)
        while not chain.operator.done and chain.net.now_ns < end_ns:
            self._faults.turn(chain)
            chain.act()
            self._advance()
        chain.operator.muted_until_ns = math.inf  # type: ignore[assignment]
        for _ in range(TAIL_MS // ACT_MS):
            self._advance()

    def _advance(self) -> None:
        """Advance to the next act."""
        chain, before = self.chain, self.chain.vehicle.truth
        chain.run(ACT_MS - chain.net.now_ns // MS % ACT_MS)
        truth = chain.vehicle.truth
        self.contacts += truth.contact and not before.contact
        self.judge.look(chain.operator, truth, chain.net.now_ns)
        seen = chain.operator.seen
        self._held.update(cause.name for cause in (seen.causes if seen else ()))

    def held(self) -> dict[str, float]:
        """Return the causes that operators saw, and for how many seconds; the longest first."""
        return {name: count * ACT_MS / 1000 for name, count in self._held.most_common()}


def fails_as(result: Result) -> Callable[[Result], bool]:
    """Return whether another result fails for the same reason."""

    def same(other: Result) -> bool:
        if result.violations:
            return bool(set(_kinds(result)) & set(_kinds(other)))
        if result.stops:
            return bool({stop.cause for stop in result.stops} & {s.cause for s in other.stops})
        return not other.finished

    return same


def _kinds(result: Result) -> list[str]:
    # Numbers differ from run to run.
    return ["".join(c for c in text if not c.isdigit()) for text in result.violations]
