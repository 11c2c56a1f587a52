"""A round from its announcement to its end: when it moves, waits and stops. Pure.

========== ============================================ ==========================================
state      the vehicle                                  ends with
========== ============================================ ==========================================
idle       no round since the start of the service      a start
announcing stands; lamp and event                       the end of the announcement
driving    follows the route                            a station with a stay; the end of the route
staying    stands at a station                          the end of the stay, or ``depart``
waiting    the way is not free                          a free way for ``FREE_S``; ``patience``
returning  follows the route home                       home
paused     a call, or another source                    ``resume``, ``return``, ``abort``
stopped    what needs a person, see ``RULES``           ``resume``, ``return``, ``abort``
done       the round is over                            a start
========== ============================================ ==========================================

The tables ``STATES`` and ``RULES`` are what the code reads. The rules are checked in their order,
in each tick; the first one that holds decides. Nothing but a person's call leaves ``stopped`` and
``paused``, so that the vehicle never begins to move by itself after a latch or a restart.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

from msgspec import Struct

from common.freshness import NS_PER_S
from common.pose import Pose
from services.patrol.core.diary import Diary
from services.patrol.core.inputs import (
    SILENT_S,
    Inputs,
    has_changed,
    is_known,
    located_of,
    lost,
)
from services.patrol.core.track import Fit
from services.patrol.core.way import Stop, Way
from t2 import messages as m
from t2.client import DriveRequests, is_blocked, is_stopped, request
from t2.messages import Phrase, Phrases
from t2.motion import Path

SOURCE = "patrol"  # in ``safety.sources``
TICK_S = 0.05
FRESH_S = 0.5  # of safety's state and the pose: older, and zero is requested
OTHER_S = 0.5  # that another source drives
UNHEARD_S = 3.0  # that requests have no effect
BLOCKED_S, FREE_S = 0.5, 1.0  # until a stop counts as waiting, and as over
PROGRESS = 0.1  # m along the route
REJOIN, NEAR = 5.0, 3.0  # m along the route: where a resumed round looks for it, and a driving one
ARRIVED = 0.05  # m before a stop
TURN_SPEED = 0.5  # rad/s
STANDING = {"no_request", "neutral", "blocked", "limit_stop"}  # stops with which a round may begin
CAUSES = 8  # phrases of safety that a state repeats
FROZEN_M, FROZEN_RAD = 1.0, 1.5  # that the vehicle was to move, without a change of the pose
CONVERGE = 1.0  # m until a vehicle beside the route is back on it


class State(NamedTuple):
    """What is possible in a state."""

    actions: tuple[m.RoundAction, ...] = ()
    is_active: bool = False  # rules are checked
    moves: bool = False  # motion is requested


STATES: dict[m.RoundState, State] = {
    "idle": State(("start",)),
    "announcing": State(("pause", "abort"), is_active=True),
    "driving": State(("pause", "return", "abort"), is_active=True, moves=True),
    "staying": State(("depart", "pause", "return", "abort"), is_active=True),
    "waiting": State(("pause", "return", "abort"), is_active=True, moves=True),
    "returning": State(("pause", "abort"), is_active=True, moves=True),
    "paused": State(("resume", "return", "abort")),
    "stopped": State(("resume", "return", "abort")),
    "done": State(("start",)),
}


class Note(Struct, frozen=True):
    """An event."""

    name: m.EventName
    level: m.Level
    phrases: Phrases


class OpenRound(Struct, frozen=True, kw_only=True):
    """What a restarted service needs to resume a round, besides its route."""

    round: m.Round
    along: float
    stop: int
    homeward: bool
    turned: bool


class Course:
    """One round of a route."""

    # Set before they are read: a round is announced or restored at once, and then goes.
    state: m.RoundState
    phrases: Phrases
    until_ns: int | None  # the end of an announcement, a stay, or the patience
    _boots: tuple[int, ...]  # of safety and localization, and the placement
    _ticked_ns: int
    _other_ns: int | None  # since when another source drives
    _path: Path | None  # to the next stop
    _heard_ns: int  # when safety obeyed, or nothing was requested
    _hindered_ns: int | None  # since when the way is not free
    _free_ns: int  # when it was not
    _progress: tuple[float, int]  # m, and when
    _still: Pose | None  # the pose since when nothing has changed
    _due: tuple[float, float]  # m, rad: what the vehicle was to move since then
    _told_blocked: bool
    _cause: Phrases  # of the last stop by safety
    _stays_at: str  # the station

    def __init__(self, route: m.Route, record: m.Round, inputs: Inputs, patience_s: float) -> None:
        self.route = route
        self.diary = Diary(record)
        self.notes: list[Note] = []  # events since they were taken
        self.way = Way(route)
        self.along = 0.0  # m on the way
        self.fit: Fit | None = None  # of the newest pose
        self._inputs = inputs
        self._patience_s = patience_s
        self._stop = 0  # the next one of the way
        self._turned = False  # whether it returns before the end of its route
        self._requests = DriveRequests()
        self._place = self.way.track.points[0]  # the newest known one, m
        self._seen: Phrase | None = None  # a latch or a lost position since the announcement

    # --- inputs -----------------------------------------------------------------------------

    def see_safety(self, state: m.SafetyState) -> None:
        """Note a latch, which may be reset before the next tick."""
        if state.latched:
            self._seen = self._seen or Phrase("patrol.latched", {"causes": state.latched})

    def see_pose(self, pose: m.MapPose) -> None:
        """Note a lost position, which may be back before the next tick."""
        if not is_known(pose):
            self._seen = self._seen or lost(pose)

    # --- calls ------------------------------------------------------------------------------

    def announce(
        self, seconds: float, now_ns: int, wall_ns: int, *, is_resumed: bool = False
    ) -> None:
        """Announce that the vehicle is about to move."""
        state, pose = self._state, self._pose
        self.diary.go_on(wall_ns)
        self._seen = None
        self._boots = state.boot, pose.boot, pose.placement
        self._ticked_ns, self._other_ns = now_ns, None
        self.until_ns = now_ns + round(seconds * NS_PER_S)
        name: m.EventName = "round_resumed" if is_resumed else "round_start"
        self._enter("announcing", Phrase("patrol.announcing", {"route": self.route.name}))
        self._note(name, "info")

    def refusal(self, now_ns: int, *, at_home: bool = False) -> Phrase | None:
        """Return why the round cannot go on, or begin ``at_home``; None if it can."""
        if reason := self._safety_refusal(now_ns) or self._pose_refusal(now_ns):
            return reason
        pose, covariance = located_of(self._pose)
        if at_home:
            x, y = self.way.track.points[0]
            distance = math.dist((x, y), (pose.x, pose.y))
            if distance + 2 * covariance.sigma > self.route.corridor:
                if distance > self.route.corridor:
                    return self._not_home(distance)
                return self._uncertain(distance, covariance.sigma)
        fit = self.way.fit(pose, covariance, self.along, REJOIN)
        return self._beside(fit)

    def rejoin(self) -> None:
        """Find the place on the route again; only after ``refusal``."""
        pose, covariance = located_of(self._pose)
        self.fit = self.way.fit(pose, covariance, self.along, REJOIN)
        self.along = self.fit.nearest.along

    def depart(self, now_ns: int) -> None:
        """End the stay at a station."""
        self._go(now_ns)

    def pause(self, wall_ns: int) -> None:
        """Stand until somebody resumes."""
        self._halt("paused", wall_ns, "round_paused", "info", Phrase("patrol.paused"))

    def turn_home(self, now_ns: int, wall_ns: int) -> None:
        """Drive home along the route, in the opposite direction."""
        self.diary.go_on(wall_ns)
        self._turned = True
        self._homeward()
        self._note("round_return", "info", Phrase("patrol.returning", {"route": self.route.name}))
        if STATES[self.state].is_active:
            self._go(now_ns)

    def abort(self, wall_ns: int) -> None:
        """End the round where the vehicle is."""
        self._end("aborted", wall_ns)

    def restore(self, of: OpenRound, wall_ns: int) -> None:
        """Take up the round of an earlier start of this service: it is stopped."""
        self.way = Way(self.route, homeward=of.homeward)
        self._place = self.way.track.point(of.along)
        self.along, self._stop, self._turned = of.along, of.stop, of.turned
        self._stopped(Phrase("patrol.restarted"), wall_ns)

    @property
    def open(self) -> OpenRound:
        """What a restarted service needs."""
        return OpenRound(
            round=self.diary.record,
            along=self.along,
            stop=self._stop,
            homeward=self.way.homeward,
            turned=self._turned,
        )

    @property
    def actions(self) -> tuple[m.RoundAction, ...]:
        """What may be asked of the round now."""
        possible = STATES[self.state].actions
        return tuple(each for each in possible if each != "return" or not self.way.homeward)

    @property
    def station(self) -> str:
        """The station ahead, or where the vehicle stays."""
        if self.state in {"staying", "done"}:
            return self._stays_at if self.state == "staying" else ""
        ahead = (stop.station for stop in self.way.stops[self._stop :] if stop.station)
        return next(ahead, self.way.home)

    # --- ticks ------------------------------------------------------------------------------

    def tick(self, now_ns: int, wall_ns: int) -> m.Drive | None:
        """Return the request of this tick, or None."""
        if not STATES[self.state].is_active:
            return self._requests.tick(None)
        self._observe()
        self._check_rules(now_ns, wall_ns)
        self._ticked_ns = now_ns
        if self.state in {"announcing", "staying"} and self._is_over(now_ns):
            self._go(now_ns)
        if STATES[self.state].moves:
            self._follow(now_ns, wall_ns)
        if not STATES[self.state].moves:
            return self._requests.tick(None)
        wanted = self._velocity(now_ns)
        if self._is_frozen(wanted):
            self._stopped(Phrase("patrol.frozen", {"distance": FROZEN_M}), wall_ns)
            return self._requests.tick(None)
        if wanted == (0.0, 0.0) or self._hears():
            self._heard_ns = now_ns
        return self._requests.tick(request(*wanted))

    def _observe(self) -> None:
        """Note where the vehicle is."""
        pose = self._inputs.pose
        if pose is None or not is_known(pose.value):
            return
        located, covariance = located_of(pose.value)
        self._place = located.x, located.y
        self.fit = self.way.fit(located, covariance, self.along, NEAR)
        if STATES[self.state].moves:
            self.diary.on_pose(located.x, located.y, self.fit)

    def _check_rules(self, now_ns: int, wall_ns: int) -> None:
        """Stop or pause the round by the first rule that holds."""
        for rule in RULES:
            if rule.moving and not STATES[self.state].moves:
                continue
            if (phrase := rule.reason(self, now_ns)) is not None:
                if rule.state == "paused":
                    self._halt("paused", wall_ns, "round_paused", "info", phrase)
                else:
                    self._stopped(phrase, wall_ns)
                return

    def _is_over(self, now_ns: int) -> bool:
        return self.until_ns is not None and now_ns >= self.until_ns

    def _follow(self, now_ns: int, wall_ns: int) -> None:
        """Arrive, wait, or go on."""
        pose, _ = located_of(self._pose)
        if self._path is None:
            self._begin_leg(pose)
        assert self._path is not None
        left = self._path.left(pose)
        self.along = max(0.0, self.way.at_stop(self._stop) - left)
        if abs(self.along - self._progress[0]) > PROGRESS:
            self._progress = self.along, now_ns
            self._told_blocked = False
        self.until_ns = self._progress[1] + round(self._patience_s * NS_PER_S)
        if left <= ARRIVED:
            self._arrive(now_ns, wall_ns)
        else:
            self._wait(now_ns, wall_ns)

    def _begin_leg(self, pose: Pose) -> None:
        self._stop = self.way.next_stop(self._stop, self.along + ARRIVED)
        points = self.way.points_to(self._stop, self.along, CONVERGE)
        self._path = Path(pose, points, self.route.speed, TURN_SPEED)
        if self.state != "waiting":
            self._enter(*self._moving())

    def _arrive(self, now_ns: int, wall_ns: int) -> None:
        stop, self._path = self.way.stops[self._stop], None
        self.along = self.way.at_stop(self._stop)
        is_last = self._stop == len(self.way.stops) - 1
        self._stop += not is_last
        if stop.station:
            self.diary.visit(stop.station, wall_ns)
            self._note("station", "info", Phrase("patrol.station", {"station": stop.station}))
        if is_last:
            self._at_end(stop, now_ns, wall_ns)
        elif stop.stay:
            self._stay(stop, now_ns, wall_ns)

    def _stay(self, stop: Stop, now_ns: int, wall_ns: int) -> None:
        self.until_ns = now_ns + round(stop.stay * NS_PER_S)
        self._stays_at = stop.station
        self.diary.go_on(wall_ns)
        self._enter("staying", Phrase("patrol.staying", {"station": stop.station}))

    def _at_end(self, stop: Stop, now_ns: int, wall_ns: int) -> None:
        """Arrive at the end of the way: at home, or where the way home begins."""
        if self.way.homeward:
            self.diary.visit(self.way.home, wall_ns)
            self._end("returned" if self._turned else "home", wall_ns)
        elif self.way.is_closed:
            self.diary.visit(self.way.home, wall_ns)
            self._end("home", wall_ns)
        else:
            self._homeward()
            if stop.stay:
                self._stay(stop, now_ns, wall_ns)
            else:
                self._go(now_ns)

    def _wait(self, now_ns: int, wall_ns: int) -> None:
        """Wait while the way is not free, and go on; after the patience as the route says."""
        state = self._state
        is_hindered = is_blocked(state) or is_stopped(state)
        if is_hindered:
            self._free_ns = now_ns
            self._hindered_ns = self._hindered_ns or now_ns
            self._cause = state.phrases[:CAUSES]
        if self._hindered_ns is not None and now_ns - self._free_ns > FREE_S * NS_PER_S:
            self._hindered_ns = None
            if self.state == "waiting":
                self.diary.go_on(wall_ns)
                self._enter(*self._moving())
        hindered_s = (now_ns - (self._hindered_ns or now_ns)) / NS_PER_S
        if self.state != "waiting" and is_hindered and hindered_s > BLOCKED_S:
            phrases = Phrase("patrol.waiting"), *self._cause
            self._halt("waiting", wall_ns, "round_waiting", "info", *phrases)
        blocked_s = (now_ns - self._progress[1]) / NS_PER_S
        if blocked_s > self._patience_s and not self._told_blocked:
            self._blocked(blocked_s, now_ns, wall_ns)

    def _blocked(self, seconds: float, now_ns: int, wall_ns: int) -> None:
        fields: dict[str, m.Field] = {"seconds": seconds}
        if self.state != "waiting":
            if self._hindered_ns is None:
                self._stopped(Phrase("patrol.stuck", fields), wall_ns)
            return
        self._told_blocked = True
        if self.route.blocked == "stop":
            self._stopped(Phrase("patrol.blocked_stop", fields), wall_ns)
            return
        self._enter("waiting", Phrase("patrol.blocked", fields), *self._cause)
        self._note("round_blocked", "warning")
        if self.route.blocked == "return" and not self.way.homeward:
            self.turn_home(now_ns, wall_ns)

    def _velocity(self, now_ns: int) -> tuple[float, float]:
        """Return the velocity to request, m/s and rad/s; zero while a stop wants it."""
        safety, pose = self._inputs.safety, self._inputs.pose
        assert safety is not None
        assert pose is not None
        is_old = max(safety.age_s(now_ns), pose.age_s(now_ns)) > FRESH_S
        if is_old or self._path is None or is_stopped(safety.value):
            return 0.0, 0.0
        located, _ = located_of(pose.value)
        return self._path.velocity(located, self._path.left(located))

    def _is_frozen(self, wanted: tuple[float, float]) -> bool:
        """Return whether the pose does not change although the vehicle was to move."""
        pose, _ = located_of(self._pose)
        before, limits = self._still, self._state.limits
        obeys = self._hindered_ns is None and self._state.source == SOURCE
        if before is None or not obeys or has_changed(before, pose):
            self._still, self._due = pose, (0.0, 0.0)
            return False
        way, turn = self._due
        way += min(abs(wanted[0]), limits.forward) * TICK_S
        turn += min(abs(wanted[1]), limits.angular) * TICK_S
        self._due = way, turn
        return way > FROZEN_M or turn > FROZEN_RAD

    def _hears(self) -> bool:
        state = self._state
        return state.source is not None or is_stopped(state)

    # --- transitions ------------------------------------------------------------------------

    def _enter(self, state: m.RoundState, *phrases: Phrase) -> None:
        self.state, self.phrases = state, phrases

    def _moving(self) -> tuple[m.RoundState, Phrase]:
        fields: dict[str, m.Field] = {"route": self.route.name, "station": self.station}
        if self.way.homeward:
            return "returning", Phrase("patrol.returning", fields)
        return "driving", Phrase("patrol.driving", fields)

    def _go(self, now_ns: int) -> None:
        """Drive on the way."""
        self.until_ns, self._path = None, None
        self._progress, self._heard_ns = (self.along, now_ns), now_ns
        self._hindered_ns, self._told_blocked, self._still = None, False, None
        self._enter(*self._moving())

    def _homeward(self) -> None:
        """Turn the way around."""
        length = self.way.track.length
        self.way = Way(self.route, homeward=True)
        self.along, self._stop, self._path = length - self.along, 0, None

    def _halt(
        self, state: m.RoundState, wall_ns: int, name: m.EventName, level: m.Level, *why: Phrase
    ) -> None:
        self.until_ns = None
        self.diary.halt(state, why, self._place, wall_ns)
        self._enter(state, *why)
        self._note(name, level)

    def _stopped(self, why: Phrase, wall_ns: int) -> None:
        phrases = why, Phrase("patrol.resume")
        self._halt("stopped", wall_ns, "round_stopped", "warning", *phrases)

    def _end(self, result: m.RoundResult, wall_ns: int) -> None:
        phrase = Phrase(f"patrol.{result}")
        self.until_ns = None
        self.diary.end(result, (phrase,), wall_ns)
        self._enter("done", phrase)
        self._note("round_end", "warning" if result == "aborted" else "info")

    def _note(self, name: m.EventName, level: m.Level, *phrases: Phrase) -> None:
        self.notes.append(Note(name, level, phrases or self.phrases))

    # --- what the rules ask -------------------------------------------------------------------

    @property
    def _state(self) -> m.SafetyState:
        assert self._inputs.safety is not None
        return self._inputs.safety.value

    @property
    def _pose(self) -> m.MapPose:
        assert self._inputs.pose is not None
        return self._inputs.pose.value

    def _safety_refusal(self, now_ns: int) -> Phrase | None:
        safety = self._inputs.safety
        if safety is None or safety.age_s(now_ns) > FRESH_S:
            return Phrase("patrol.safety_silent")
        if latched := safety.value.latched:
            return Phrase("patrol.latched", {"causes": latched})
        if (source := safety.value.source) not in {None, SOURCE}:
            return Phrase("patrol.other_drives", {"source": source})
        stops = (each.name for each in safety.value.causes if each.action != "slow")
        if causes := tuple(name for name in stops if name not in STANDING):
            return Phrase("patrol.forbidden", {"causes": causes})
        return None

    def _pose_refusal(self, now_ns: int) -> Phrase | None:
        pose = self._inputs.pose
        if pose is None or pose.age_s(now_ns) > FRESH_S:
            return Phrase("patrol.map_silent")
        return None if is_known(pose.value) else lost(pose.value)

    def _held_up(self, now_ns: int) -> Phrase | None:
        gap_s = (now_ns - self._ticked_ns) / NS_PER_S
        return Phrase("patrol.held_up", {"seconds": gap_s}) if gap_s > SILENT_S else None

    def _twice(self, now_ns: int) -> Phrase | None:
        return self._inputs.twice(now_ns)

    def _silent(self, now_ns: int) -> Phrase | None:
        safety, pose = self._inputs.safety, self._inputs.pose
        if safety is None or safety.age_s(now_ns) > SILENT_S:
            return Phrase("patrol.safety_silent")
        if pose is None or pose.age_s(now_ns) > SILENT_S:
            return Phrase("patrol.map_silent")
        return None

    def _latched_or_lost(self, _: int) -> Phrase | None:
        return self._seen

    def _restarted(self, _: int) -> Phrase | None:
        safety, localization, placement = self._boots
        if self._state.boot != safety:
            return Phrase("patrol.safety_restarted")
        if self._pose.boot != localization:
            return Phrase("patrol.map_restarted")
        if self._pose.placement != placement:
            return Phrase("patrol.placed")
        return None

    def _overruled(self, now_ns: int) -> Phrase | None:
        source = self._state.source
        if source in {None, SOURCE}:
            self._other_ns = None
            return None
        self._other_ns = self._other_ns or now_ns
        if now_ns - self._other_ns <= OTHER_S * NS_PER_S:
            return None
        return Phrase("patrol.overruled", {"source": source})

    def _left_corridor(self, _: int) -> Phrase | None:
        return self._beside(self.fit) if self.fit is not None else None

    def _unheard(self, now_ns: int) -> Phrase | None:
        is_unheard = now_ns - self._heard_ns > UNHEARD_S * NS_PER_S
        return Phrase("patrol.unheard") if is_unheard else None

    def _beside(self, fit: Fit) -> Phrase | None:
        """Return why a pose is not surely in the corridor; None if it is."""
        if fit.margin >= 0:
            return None
        deviation = fit.nearest.deviation
        if deviation > fit.corridor:
            fields: dict[str, m.Field] = {"deviation": deviation, "corridor": fit.corridor}
            return Phrase("patrol.outside", fields)
        return self._uncertain(deviation, fit.sigma)

    def _not_home(self, distance: float) -> Phrase:
        route = self.route
        fields: dict[str, m.Field] = {
            "distance": distance, "route": route.name, "corridor": route.corridor
        }  # fmt: skip
        return Phrase("patrol.not_home", fields)

    def _uncertain(self, deviation: float, sigma: float) -> Phrase:
        corridor = self.route.corridor
        fields: dict[str, m.Field] = {"deviation": deviation, "sigma": sigma, "corridor": corridor}
        return Phrase("patrol.uncertain", fields)


class Rule(NamedTuple):
    """What stops or pauses a round."""

    state: m.RoundState
    reason: Callable[[Course, int], Phrase | None]
    moving: bool = False  # only while it moves


RULES = (
    Rule("stopped", Course._held_up),
    Rule("stopped", Course._twice),
    Rule("stopped", Course._silent),
    Rule("stopped", Course._restarted),
    Rule("stopped", Course._latched_or_lost),
    Rule("paused", Course._overruled),
    Rule("stopped", Course._left_corridor, moving=True),
    Rule("stopped", Course._unheard, moving=True),
)
