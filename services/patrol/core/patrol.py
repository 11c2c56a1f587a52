"""Patrol of one vehicle: the round, the route that is being taught, and who may ask for what."""

import math

from msgspec.structs import replace

from common.freshness import NS_PER_S, Latest, fresh
from services.patrol.core.course import FRESH_S, Course, Note, OpenRound
from services.patrol.core.inputs import Inputs
from services.patrol.core.routes import length, stations
from services.patrol.core.teaching import CORRIDOR, OpenTeaching, Refused, Teaching
from services.patrol.core.way import CLOSED
from t2 import messages as m
from t2.messages import Phrase, Phrases
from t2.words import render

STATIONS = 128  # that the state lists
STOPPING = {"pause", "abort"}  # actions that are done however late, and beside another service
SPEED = 0.5  # m/s, of a new route; its file has it


class Patrol:
    """What the service knows; calls return why they are refused, or None."""

    def __init__(self, robot: str, announce_s: float, patience_s: float) -> None:
        self.course: Course | None = None
        self.notes: list[Note] = []  # events since they were taken
        self._robot = robot
        self._announce_s, self._patience_s = announce_s, patience_s
        self._inputs = Inputs()
        self._teaching: Teaching | None = None

    # --- inputs -----------------------------------------------------------------------------

    def on_safety(self, state: m.SafetyState, now_ns: int) -> None:
        """Process a state of safety."""
        self._inputs.safety = Latest(state, now_ns)
        if self.course is not None:
            self.course.see_safety(state)

    def on_pose(self, pose: m.MapPose, now_ns: int) -> None:
        """Process a pose in the map."""
        self._inputs.pose = Latest(pose, now_ns)
        if self.course is not None:
            self.course.see_pose(pose)
        teaching = self._teaching
        if teaching is not None and teaching.reason is None:
            teaching.on_pose(pose)
            if teaching.phrases:
                self.notes.append(Note("teaching", "warning", teaching.phrases))

    def on_other(self, now_ns: int) -> None:
        """Note that another patrol service runs for this robot."""
        self._inputs.other_ns = now_ns

    def tick(self, now_ns: int, wall_ns: int) -> m.Drive | None:
        """Return the request of this tick, or None."""
        if self.course is None:
            return None
        request = self.course.tick(now_ns, wall_ns)
        self._take_notes(self.course)
        return request

    # --- rounds -----------------------------------------------------------------------------

    @property
    def is_open(self) -> bool:
        """Whether a round is not over."""
        return self.course is not None and self.course.state != "done"

    def start(
        self, route: m.Route, round_id: str, schedule: str, now_ns: int, wall_ns: int
    ) -> Phrase | None:
        """Start a round on a route that has no problem."""
        if reason := self._inputs.twice(now_ns) or self._start_refusal(route):
            return reason
        record = m.Round(
            id=round_id, route=route.name, robot=self._robot, schedule=schedule, start_ns=wall_ns
        )
        course = Course(route, record, self._inputs, self._patience_s)
        if reason := course.refusal(now_ns, at_home=True):
            return reason
        course.rejoin()
        self.course = course
        course.announce(self._announce_s, now_ns, wall_ns)
        self._take_notes(course)
        return None

    def act(self, action: m.RoundAction, now_ns: int, wall_ns: int) -> Phrase | None:
        """Act on the round; "start" is another call."""
        course = self.course
        if action not in STOPPING and (reason := self._inputs.twice(now_ns)):
            return reason  # the other service answers the call, too
        if course is None or action not in course.actions:
            return self._not_now(action)
        # A restored round may be in a folder that was copied from another robot.
        if action in {"resume", "return"} and (foreign := self._foreign(course.route)):
            return foreign
        reason = self._act(course, action, now_ns, wall_ns)
        self._take_notes(course)
        return reason

    def forget(self) -> None:
        """Forget a round that has just been announced, and cannot be written."""
        self.course, self.notes = None, []

    def restore(self, of: OpenRound, route: m.Route, wall_ns: int) -> None:
        """Take up the round of an earlier start of this service."""
        self.course = Course(route, of.round, self._inputs, self._patience_s)
        self.course.restore(of, wall_ns)
        self._take_notes(self.course)

    def _act(
        self, course: Course, action: m.RoundAction, now_ns: int, wall_ns: int
    ) -> Phrase | None:
        goes_on = course.state in {"paused", "stopped"} and action in {"resume", "return"}
        if goes_on and (reason := course.refusal(now_ns)):
            return reason
        if action == "depart":
            course.depart(now_ns)
        elif action == "pause":
            course.pause(wall_ns)
        elif action == "abort":
            course.abort(wall_ns)
        if goes_on:
            course.rejoin()
        if action == "return":
            course.turn_home(now_ns, wall_ns)
        if goes_on:
            course.announce(self._announce_s, now_ns, wall_ns, is_resumed=True)
        return None

    def _start_refusal(self, route: m.Route) -> Phrase | None:
        if self.course is not None and self.is_open:
            return Phrase("patrol.busy", {"route": self.course.route.name})
        if self._teaching is not None:
            return Phrase("patrol.teaching", {"route": self._teaching.name})
        return self._foreign(route)

    def _foreign(self, route: m.Route) -> Phrase | None:
        if route.robot != self._robot:
            fields: dict[str, m.Field] = {
                "route": route.name, "other": route.robot, "robot": self._robot
            }  # fmt: skip
            return Phrase("patrol.other_robot", fields)
        return None

    def _not_now(self, action: m.RoundAction) -> Phrase:
        state: m.RoundState = "idle"
        actions: tuple[m.RoundAction, ...] = ("start",)
        if self.course is not None:
            state, actions = self.course.state, self.course.actions
        fields: dict[str, m.Field] = {
            "action": action, "state": state, "actions": actions
        }  # fmt: skip
        return Phrase("patrol.not_now", fields)

    def _take_notes(self, course: Course) -> None:
        self.notes += course.notes
        course.notes = []

    # --- routes -----------------------------------------------------------------------------

    def begin(self, name: str, home: str, stay: float, now_ns: int) -> Phrases:
        """Begin to teach a route where the vehicle is; raise ``Refused``."""
        if reason := self._inputs.twice(now_ns):
            raise Refused(reason)
        if self.is_open and self.course is not None:
            raise Refused(Phrase("patrol.busy", {"route": self.course.route.name}))
        if self._teaching is not None:
            raise Refused(Phrase("patrol.teaching", {"route": self._teaching.name}))
        self._teaching = Teaching(name, self._robot, home, stay, self._fresh_pose(now_ns))
        return self._noted("teaching", Phrase("teach.begun", {"route": name}))

    def restore_teaching(self, of: OpenTeaching) -> None:
        """Take up the route that was being taught at an earlier start of this service."""
        self._teaching = Teaching.restored(of, self._robot)
        self.notes.append(Note("teaching", "warning", self._teaching.phrases))

    @property
    def open_teaching(self) -> OpenTeaching | None:
        """What was taught so far; None while no route is taught."""
        return None if self._teaching is None else self._teaching.open

    def station(self, name: str, stay: float, now_ns: int) -> Phrases:
        """Mark a station; raise ``Refused``."""
        teaching, _ = self._taught, self._fresh_pose(now_ns)
        teaching.station(name, stay)
        found, _ = self._taught.summary
        return (Phrase("teach.station", {"station": name, "length": found}),)

    def _fresh_pose(self, now_ns: int) -> m.MapPose:
        pose = self._inputs.pose
        if pose is None or not fresh(pose, now_ns, FRESH_S):
            raise Refused(Phrase("teach.lost"))
        return pose.value

    def taught(self) -> m.Route:
        """Return the route as it has been taught so far; raise ``Refused``."""
        return self._taught.route(SPEED)

    def end(self, route: m.Route) -> Phrases:
        """End teaching, after its route was saved."""
        self._teaching = None
        fields: dict[str, m.Field] = {
            "route": route.name, "length": length(route), "count": len(stations(route))
        }  # fmt: skip
        first, last = route.points[0], route.points[-1]
        distance = math.dist((first.x, first.y), (last.x, last.y))
        is_loop = distance <= CLOSED
        way: dict[str, m.Field] = {} if is_loop else {"distance": distance, "closing": CORRIDOR}
        phrase = Phrase("teach.loop" if is_loop else "teach.open", way)
        return self._noted("teaching", Phrase("teach.ended", fields), phrase)

    def cancel(self) -> Phrases:
        """End teaching without a route; raise ``Refused``."""
        name, self._teaching = self._taught.name, None
        return self._noted("teaching", Phrase("teach.cancelled", {"route": name}))

    def change_refusal(self, name: str) -> Phrase | None:
        """Return why a route may not be changed now."""
        if self.course is not None and self.is_open and self.course.route.name == name:
            return Phrase("teach.driven", {"route": name})
        return None

    def _noted(self, name: m.EventName, *phrases: Phrase) -> Phrases:
        self.notes.append(Note(name, "info", phrases))
        return phrases

    @property
    def _taught(self) -> Teaching:
        if self._teaching is None:
            raise Refused(Phrase("teach.none"))
        return self._teaching

    # --- output -----------------------------------------------------------------------------

    def message(self, now_ns: int) -> m.PatrolState:
        """Return the state, without the next round."""
        course, teaching = self.course, self._teaching
        phrases: Phrases = (Phrase("patrol.idle"),) if course is None else course.phrases
        if course is None and (twice := self._inputs.twice(now_ns)):
            phrases = (twice,)
        actions: tuple[m.RoundAction, ...] = ("start",) if course is None else course.actions
        message = m.PatrolState(
            state="idle" if course is None else course.state,
            text=render(phrases),
            phrases=phrases,
            actions=tuple(each for each in actions if each != "start" or teaching is None),
            teaching=None if teaching is None else _teaching_message(teaching),
        )
        return message if course is None else _with_round(message, course, now_ns)


def _with_round(message: m.PatrolState, course: Course, now_ns: int) -> m.PatrolState:
    left = None if course.until_ns is None else max(0.0, (course.until_ns - now_ns) / NS_PER_S)
    fit = course.fit
    return replace(
        message,
        round=course.diary.record.id,
        route=course.route.name,
        homeward=course.way.homeward,
        progress=course.way.progress(course.along),
        length=course.way.track.length,
        station=course.station,
        left=left if course.state in {"announcing", "staying", "waiting"} else None,
        deviation=None if fit is None else fit.nearest.deviation,
        sigma=None if fit is None else fit.sigma,
        corridor=course.route.corridor,
    )


def _teaching_message(teaching: Teaching) -> m.Teaching:
    found, points = teaching.summary
    return m.Teaching(
        route=teaching.name,
        length=found,
        points=points,
        stations=teaching.stations[:STATIONS],
        text=render(teaching.phrases),
        phrases=teaching.phrases,
    )
