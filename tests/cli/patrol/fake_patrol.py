"""A simulated patrol service, with a safety service."""

from typing import Any

from common.bus.bus import Bus, Caller
from t2 import keys
from t2 import messages as m
from t2.messages import Phrase
from t2.words import done
from tests.cli.inspect.tool import FakeSafety, pretend
from tests.common.bus_fixture import BusFixture

YARD = m.Route(
    name="院子",
    robot="001",
    points=(
        m.RoutePoint(x=0.0, y=0.0, station="大门"),
        m.RoutePoint(x=3.0, y=0.0, station="gate", stay=2.0),
        m.RoutePoint(x=3.0, y=2.0),
    ),
)
HALT = m.Halt(
    state="waiting", t_ns=1_700_000_010_000_000_000, seconds=4.0, x=1.0, y=0.1, text="<b>Waiting",
)  # fmt: skip
ROUND = m.Round(
    id="20261128-夜",
    route="院子",
    robot="001",
    start_ns=1_700_000_000_000_000_000,
    end_ns=1_700_000_065_000_000_000,
    result="home",
    text="The round is complete.",
    distance=5.0,
    visits=(m.Visit(station="gate", t_ns=1_700_000_020_000_000_000),),
    halts=(HALT,),
    deviation=0.1,
    sigma=0.05,
    margin=0.3,
)
TRACK = tuple(m.TrackPoint(x=x / 10, y=0.02, deviation=0.02, sigma=0.05) for x in range(31))
STATE = m.PatrolState(
    state="driving",
    text="Driving.",
    phrases=(Phrase("patrol.driving", {"route": "院子", "station": "gate"}),),
    round="1",
    route="院子",
    progress=1.0,
    length=5.0,
    station="gate",
    deviation=0.1,
    sigma=0.05,
    corridor=0.5,
    next=m.NextRound(schedule="night", route="院子", t_ns=1_700_000_000_000_000_000),
)


class FakePatrol:
    """Answers the calls, and keeps the requests; an action that it does not know is refused."""

    def __init__(self, buses: BusFixture, *, safety: bool = True) -> None:
        self.asked: list[Any] = []
        self.state = STATE
        self.routes: tuple[m.RouteSummary, ...] = (
            m.RouteSummary(name="院子", length=5.0, stations=("大门", "gate")),
            m.RouteSummary(name="hall", problem="hall.json: broken."),
        )
        self.rounds: tuple[m.Round, ...] = (ROUND,)
        self.track: tuple[m.TrackPoint, ...] = TRACK
        self.route: m.Route | None = YARD
        self.safety = FakeSafety(buses) if safety else None
        pretend(buses, "patrol", {keys.PATROL: lambda: self.state}, self._declare)

    def _declare(self, bus: Bus) -> None:
        bus.serve(keys.TEACH, self._do)
        bus.serve(keys.ROUND, self._do)
        bus.serve(keys.ROUTES, self._on_routes)
        bus.serve(keys.ROUNDS, self._on_rounds)

    def _do(self, request: Any, caller: Caller[m.Done]) -> None:
        self.asked.append(request)
        if request.action == "abort":
            caller.refuse(Phrase("teach.none"))
        else:
            caller.reply(done(Phrase("patrol.done")))

    def _on_routes(self, request: m.RoutesRequest, caller: Caller[m.RoutesReply]) -> None:
        if request.route is None:
            caller.reply(m.RoutesReply(routes=self.routes))
        elif self.route is None or request.route != self.route.name:
            caller.refuse(Phrase("route.none", {"route": request.route}))
        else:
            caller.reply(m.RoutesReply(route=self.route))

    def _on_rounds(self, request: m.RoundsRequest, caller: Caller[m.RoundsReply]) -> None:
        self.asked.append(request)
        if request.round in {"", *(each.id for each in self.rounds)}:
            kept = m.RoundsReply(rounds=self.rounds, route=self.route, track=self.track)
            caller.reply(kept if request.round else m.RoundsReply(rounds=self.rounds))
        else:
            caller.refuse(Phrase("patrol.no_round", {"round": request.round}))
