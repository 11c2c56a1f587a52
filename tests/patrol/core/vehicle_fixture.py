"""A vehicle that does what patrol requests, with a localization and a safety of a few lines."""

import math
from collections.abc import Sequence
from typing import Any

from common.freshness import NS_PER_S
from common.pose import Pose
from services.patrol.core.course import TICK_S, Note
from services.patrol.core.patrol import Patrol
from t2 import messages as m
from tests.factories import map_pose, safety_state
from tests.untraced import untraced

ANNOUNCE_S, PATIENCE_S = 1.0, 20.0
TICK_NS = round(TICK_S * NS_PER_S)
LONGEST_NS = 600 * NS_PER_S  # of a test: it fails, and does not wait for ever
LINE = ((0.0, 0.0, "home"), (4.0, 0.0, "gate"))
LOOP = ((0.0, 0.0, "home"), (4.0, 0.0, "gate"), (4.0, 3.0), (0.0, 3.0), (0.0, 0.0))
HOME = Pose(0.0, 0.0, 0.0)
CAUSES: dict[m.CauseName, m.Action] = {
    "blocked": "stop", "limit_stop": "stop", "switches": "stop", "estop": "brake",
}  # fmt: skip


def route(points: Sequence[Any] = LINE, *, stay: float = 0.0, **fields: Any) -> m.Route:
    """Return a route; a point is x, y, and the name of its station if it has one."""
    made = tuple(
        m.RoutePoint(x=x, y=y, station=name[0], stay=stay) if name else m.RoutePoint(x=x, y=y)
        for x, y, *name in points
    )
    return m.Route(**{"name": "yard", "robot": "001", "points": made} | fields)


class Vehicle:
    """The vehicle, in simulated time."""

    def __init__(self, at: Pose = HOME) -> None:
        self.patrol = Patrol("001", ANNOUNCE_S, PATIENCE_S)
        self.at = at
        self.now_ns, self.wall_ns = NS_PER_S, 10**18
        self.sigma = 0.05  # m and rad
        self.causes: tuple[m.CauseName, ...] = ()
        self.latched: tuple[m.CauseName, ...] = ()
        self.source: str | None = None  # another one that drives
        self.boots = {"safety": 1, "localization": 1}
        self.placement = 1
        self.map_state: m.MapState = "placed"
        self.silent: set[str] = set()
        self.requests: list[m.Drive] = []  # in the last call of ``run``
        self.notes: list[Note] = []  # events

    # --- its world --------------------------------------------------------------------------

    def step(self) -> None:
        """Deliver what safety and localization publish, tick, and move."""
        self.now_ns += TICK_NS
        self.wall_ns += TICK_NS
        assert self.now_ns < LONGEST_NS, self.message.text
        if "safety" not in self.silent:
            self.patrol.on_safety(self._state(), self.now_ns)
        if "localization" not in self.silent:
            self.patrol.on_pose(self._pose(), self.now_ns)
        request = self.patrol.tick(self.now_ns, self.wall_ns)
        self.notes += self.patrol.notes
        self.patrol.notes = []
        if request is not None:
            self.requests.append(request)
            if not (self.causes or self.latched or self.source):
                self.at = self.at.moved(request.linear * TICK_S, request.angular * TICK_S)

    def _state(self) -> m.SafetyState:
        names = (*self.causes, *self.latched)
        causes = tuple(
            m.Cause(name=name, action=CAUSES[name], age=1.0, text=name) for name in names
        )
        is_requested = bool(self.requests) and self.state in {"driving", "waiting", "returning"}
        return safety_state(
            boot=self.boots["safety"],
            latched=self.latched,
            causes=causes,
            source=self.source or ("patrol" if is_requested else None),
            phrases=(m.Phrase("blocked"),) if causes else (),
        )

    def _pose(self) -> m.MapPose:
        variance = self.sigma**2
        fields: dict[str, Any] = {
            "x": self.at.x,
            "y": self.at.y,
            "heading": self.at.heading,
            "pose_covariance": (variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance),
        }
        fields = fields if self.map_state != "unplaced" else {}
        boot, placement = self.boots["localization"], self.placement
        return map_pose(self.map_state, boot=boot, placement=placement, **fields)

    # --- the test's hands -------------------------------------------------------------------

    @property
    def state(self) -> m.RoundState:
        """The state of the round."""
        return self.message.state

    @property
    def message(self) -> m.PatrolState:
        """What the service publishes."""
        return self.patrol.message(self.now_ns)

    @property
    def reasons(self) -> tuple[str, ...]:
        """The names of the phrases of the state."""
        return tuple(phrase.name for phrase in self.message.phrases)

    @property
    def events(self) -> list[str]:
        """The names of the events."""
        return [note.name for note in self.notes]

    def run(self, seconds: float) -> None:
        """Let time pass."""
        self.requests = []
        for _ in range(round(seconds / TICK_S)):
            self.step()

    def until(self, *states: m.RoundState, within: float = 120.0) -> m.RoundState:
        """Let time pass until one of the states; return it."""
        self.requests = []
        for _ in range(round(within / TICK_S)):
            if self.state in states:
                return self.state
            self.step()
        raise AssertionError(f"{self.state} after {within} s: {self.message.text}")

    def start(self, of: m.Route | None = None) -> str | None:
        """Start a round; return the name of the reason of a refusal."""
        self.step()
        reason = self.patrol.start(of or route(), "one", "", self.now_ns, self.wall_ns)
        return reason.name if reason else None

    def act(self, action: m.RoundAction) -> str | None:
        """Act on the round; return the name of the reason of a refusal."""
        self.step()
        reason = self.patrol.act(action, self.now_ns, self.wall_ns)
        return reason.name if reason else None

    @untraced()
    def driving(self, of: m.Route | None = None, *, until_x: float = 1.0) -> "Vehicle":
        """Start a round, and drive until this place."""
        assert self.start(of) is None
        while self.at.x < until_x or self.state != "driving":
            self.step()
        return self

    @property
    def moves(self) -> bool:
        """Whether motion was requested since the last ``run``."""
        return any(each.linear or each.angular for each in self.requests)

    def push(self, x: float = 0.0, y: float = 0.0, turn: float = 0.0) -> None:
        """Move the vehicle by hand, m and rad."""
        heading = math.remainder(self.at.heading + turn, math.tau)
        self.at = Pose(self.at.x + x, self.at.y + y, heading)


@untraced()
def vehicle_in(state: m.RoundState) -> Vehicle:
    """Return a vehicle whose round is in a state, on the way to the gate at x = 4 m."""
    vehicle = Vehicle()
    if state == "idle":
        vehicle.step()
    elif state == "announcing":
        assert vehicle.start() is None
    elif state == "staying":
        assert vehicle.start(route(LOOP, stay=5.0)) is None
        vehicle.until("staying")
    elif state == "done":
        vehicle.driving()
        vehicle.act("abort")
    else:
        vehicle.driving()
        _lead(vehicle, state)
    assert vehicle.state == state
    return vehicle


def _lead(vehicle: Vehicle, state: m.RoundState) -> None:
    if state == "waiting":
        vehicle.causes = ("blocked",)
        vehicle.until("waiting")
    elif state == "returning":
        vehicle.act("return")
    elif state == "paused":
        vehicle.act("pause")
    elif state == "stopped":
        vehicle.latched = ("estop",)
        vehicle.until("stopped")
        vehicle.latched = ()
