"""Patrol of a robot: routes, and rounds on them."""

from collections.abc import Callable
from typing import Any

import zenoh

from t2 import keys
from t2 import messages as m
from t2.motion import finite
from t2.stream import Stream

Call = Callable[[keys.Call[Any, Any], Any], Any]


class Patrol(Stream[m.PatrolState]):
    """The stream of patrol's state, and the calls to it; ``Robot.patrol``.

    Calls raise ``Refused`` with the reason, ``NotAllowed``, and ``NoData`` without patrol; except
    for ``pause`` and ``abort``, also without safety.

    >>> robot.place(0.0, 0.0, 0.0, sigma=0.03)
    >>> robot.patrol.teach("yard", "home")
    >>> with robot.drive("nav") as drive:
    ...     pose = drive.forward(1.0)
    >>> robot.patrol.station("gate", stay=5.0)
    >>> robot.patrol.end()
    >>> [route.stations for route in robot.patrol.routes()]
    [('home', 'gate')]
    >>> robot.patrol.latest().state
    'idle'
    """

    def __init__(
        self, session: zenoh.Session, robot: str, safety: Stream[m.SafetyState], call: Call
    ) -> None:
        super().__init__(session, keys.PATROL.on(robot), m.PatrolState, "patrol")
        self._safety = safety
        self._call = call

    # --- rounds -------------------------------------------------------------------------------

    def start(self, route: str) -> None:
        """Start a round, and return at once; the vehicle must be at home, the first station."""
        self._act("start", route)

    def depart(self) -> None:
        """End the stay at a station."""
        self._act("depart")

    def pause(self) -> None:
        """Stop until somebody resumes; it works without safety, too."""
        self._act("pause")

    def resume(self) -> None:
        """Go on with a round that is paused or stopped."""
        self._act("resume")

    def go_home(self) -> None:
        """Drive home along the route, in the opposite direction."""
        self._act("return")

    def abort(self) -> None:
        """End the round where the vehicle is; it works without safety, too."""
        self._act("abort")

    def rounds(self, most: int = 50) -> tuple[m.Round, ...]:
        """Return the rounds that are over, the newest first."""
        reply: m.RoundsReply = self._call(keys.ROUNDS, m.RoundsRequest(most=most))
        return reply.rounds

    def round(self, round_id: str) -> m.RoundsReply:
        """Return one round in ``rounds``, with its ``route`` and ``track`` if they are kept."""
        reply: m.RoundsReply = self._call(keys.ROUNDS, m.RoundsRequest(round=round_id))
        return reply

    def _act(self, action: m.RoundAction, route: str | None = None) -> None:
        echo = None if action in {"pause", "abort"} else self._echo()
        self._call(keys.ROUND, m.RoundRequest(action=action, route=route, echo=echo))

    # --- routes -------------------------------------------------------------------------------

    def routes(self) -> tuple[m.RouteSummary, ...]:
        """Return all routes; one that cannot be driven has a ``problem``."""
        reply: m.RoutesReply = self._call(keys.ROUTES, m.RoutesRequest())
        return reply.routes

    def route(self, name: str) -> m.Route:
        """Return a route with its points."""
        reply: m.RoutesReply = self._call(keys.ROUTES, m.RoutesRequest(route=name))
        assert reply.route is not None
        return reply.route

    def save(self, route: m.Route) -> None:
        """Save a route; it replaces the one of its name."""
        self._teach("save", points=route)

    def delete(self, name: str) -> None:
        """Delete a route."""
        self._teach("delete", route=name)

    def teach(self, name: str, station: str, stay: float = 0.0) -> None:
        """Begin to teach a route where the vehicle is: its home, with this name.

        Drive forward then, as any source, and mark stations. ``stay`` is the time in s that a
        round stays there.
        """
        self._teach("begin", route=name, station=station, stay=finite(stay))

    def station(self, name: str, stay: float = 0.0) -> None:
        """Mark a station where the vehicle is."""
        self._teach("station", station=name, stay=finite(stay))

    def end(self) -> None:
        """End teaching, and save the route."""
        self._teach("end")

    def cancel(self) -> None:
        """End teaching without a route."""
        self._teach("cancel")

    def _teach(self, action: m.TeachAction, **fields: Any) -> None:
        self._call(keys.TEACH, m.TeachRequest(action=action, echo=self._echo(), **fields))

    def _echo(self) -> int:
        return self._safety.latest().heartbeat
