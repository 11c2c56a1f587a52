"""A vehicle for the standstill supervision alone, without a policy."""

import math

from common.freshness import NS_PER_S, Latest
from common.messages import Mileage
from common.motion import Twist
from services.safety.standstill import Measured, Phase, Standstill, Supervisor
from tests.safety.policy_fixture import TICK_S

TICK_NS = round(TICK_S * NS_PER_S)
SUPERVISOR = Supervisor(0.6, 1.0, Twist(1.0, 1.0))


class Board:
    """A vehicle for the pure core: reports by hand, standstill commanded."""

    def __init__(self, standstill: Standstill | None = None) -> None:
        self.state = standstill or Standstill()
        self.now_ns = 10 * NS_PER_S
        self.distance = self.heading = 0.0
        self.epoch, self.boot = 0, 1
        self.counts = True
        self.mono_ns = 0
        self.supervisor = SUPERVISOR

    def step(
        self, linear: float | None = 0.0, angular: float = 0.0, commanded: bool = True
    ) -> Standstill:
        """Run a tick with one velocity, or without one."""
        self.now_ns += TICK_NS
        known = None if linear is None else Latest(Twist(linear, angular), self.now_ns)
        counters = Mileage(
            distance=self.distance,
            heading=math.remainder(self.heading, math.tau),
            epoch=self.epoch,
            boot=self.boot,
            mono_ns=self.mono_ns,
        )
        seen = Measured(known, Latest(counters, self.now_ns) if self.counts else None)
        self.state = self.supervisor.follow(self.state, commanded, seen, self.now_ns)
        return self.state

    def run(self, seconds: float, linear: float | None = 0.0, angular: float = 0.0) -> bool:
        """Report the same for a while; return whether the place was left meanwhile."""
        steps = [self.step(linear, angular).left for _ in range(round(seconds / TICK_S))]
        return any(steps)

    def late(self) -> bool:
        return self.state.is_late(self.now_ns)


def standing() -> Board:
    board = Board()
    assert not board.run(1.0)
    assert board.state.phase is Phase.STANDING
    return board
